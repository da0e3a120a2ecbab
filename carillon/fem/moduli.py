"""Young's moduli of a solid, one a cell or one a quadrature point: given, made, or from a file."""

import math
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.limits import LARGEST_CONTRAST, MODULI

POINTS = 8
"""Quadrature points of a cell."""
_REAL = "fiu"
_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
_MOST_COMMENTS, _MOST_OF_VALUE = 1 << 20, 64
"""Most bytes of comments in a text file of moduli, and of one value."""


def require_moduli(
    young: ArrayLike, cells: int, source: str = "moduli", points: bool = True
) -> Array:
    """Moduli [Pa] that a user gives, (cells,) or (cells, 8), as floats of the same shape.

    Without `points` those of quadrature points are refused. Raises UserError if they are of another
    shape, no real numbers, not finite, not positive, or beyond the limits of `carillon.limits`;
    `source` is where they are from.

    Examples
    --------
    >>> require_moduli([1e9, 2e9], cells=2).shape
    (2,)
    >>> require_moduli([1e9, -2e9], cells=2)
    Traceback (most recent call last):
    carillon.errors.UserError: moduli: 1 values are negative (the first at index 1: -2e+09); \
    expected Young's moduli [Pa]
    """
    shapes = ((cells,), (cells, POINTS)) if points else ((cells,),)
    values = _not_negative(young, shapes, source)
    bad = np.argwhere(values == 0.0)
    if len(bad):
        raise UserError(
            f"{source}: {len(bad):,} voxels have modulus zero (the first at index {bad[0, 0]}); "
            "give them a small positive modulus or take them out of the mesh, since mass without "
            "stiffness has no place in a spectrum"
        )
    low, high = float(values.min()), float(values.max())
    if low < MODULI[0] or high > MODULI[1] or high > LARGEST_CONTRAST * low:
        raise UserError(
            f"{source}: moduli from {low:g} to {high:g} Pa, expected {MODULI[0]:g} to "
            f"{MODULI[1]:g} Pa, the largest at most {LARGEST_CONTRAST:g} times the least"
        )
    return values


def require_coarse_moduli(moduli: Array, cells: int) -> Array:
    """Moduli (cells, 8) that a coarsening made, which knows no limits and may make some zero.

    Raises UserError if they are of another shape, not finite, negative or all zero.
    """
    return _not_negative(moduli, ((cells, POINTS),), "coarse moduli")


def at_points(young: Array) -> Array:
    """Moduli (m, 8) at the quadrature points from those of the cells (m,), or these themselves."""
    return young if young.ndim == 2 else np.repeat(young[:, None], POINTS, axis=1)


def _not_negative(young: ArrayLike, shapes: tuple[tuple[int, ...], ...], source: str) -> Array:
    given = np.asarray(young)
    if given.shape not in shapes:
        expected = " or ".join(map(str, shapes))
        raise UserError(f"{source}: an array of shape {given.shape}, expected {expected}")
    if given.dtype.kind not in _REAL:
        raise UserError(f"{source}: an array of {given.dtype}, expected real numbers")
    values = np.ascontiguousarray(given, dtype=float)
    bad = np.argwhere(~np.isfinite(values))
    if len(bad):
        raise UserError(
            f"{source}: {len(bad):,} values are not finite (the first at index {bad[0, 0]}); "
            "expected Young's moduli [Pa]"
        )
    bad = np.argwhere(values < 0.0)
    if len(bad):
        raise UserError(
            f"{source}: {len(bad):,} values are negative (the first at index {bad[0, 0]}: "
            f"{values[tuple(bad[0])]:g}); expected Young's moduli [Pa]"
        )
    if not values.any():
        raise UserError(f"{source}: all {values.size:,} values are zero; expected moduli [Pa]")
    return values


def read_moduli(path: Path, count: int, label: str) -> Array:
    """Moduli (count,) [Pa] from a numpy `.npy` or text file.

    An array is not read unless it says itself that it holds so many real numbers. `label`: the mesh
    that they are for, in messages. Raises UserError if the file is unreadable, holds anything but
    real numbers or another number of them, or for values that are not finite, not positive or out
    of range.
    """
    read = _from_npy if path.suffix == ".npy" else _from_text
    try:
        values = read(path, count)
    except (OSError, ValueError, TypeError, EOFError, OverflowError, SyntaxError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise UserError(
            f"{path}: is not readable as an array of numbers ({reason}); expected a .npy or text "
            "file with one Young's modulus [Pa] per voxel"
        ) from None
    if isinstance(values, int):
        raise UserError(f"{path}: {values:,} values for {count:,} voxels ({label})")
    return require_moduli(values, count, str(path))


def _from_npy(path: Path, count: int) -> Array | int:
    """The numbers of a .npy file, or how many there are if they are not `count`."""
    with open(path, "rb") as stream:
        version = np.lib.format.read_magic(stream)
        if version not in _HEADERS:
            raise ValueError(f"version {version} of the format")
        try:
            shape, by_columns, dtype = _HEADERS[version](stream)
        except Exception as error:  # numpy reads it as Python, which has many ways to fail
            raise ValueError(f"its header makes no sense: {error}") from None
        if dtype.kind not in _REAL:
            raise ValueError(f"holds {dtype}")
        size = math.prod(shape)
        if size != count:
            return size
        values = np.fromfile(stream, dtype, count)
        if len(values) != count or stream.read(1):
            raise ValueError("shorter or longer than its header says")
    whole = values.reshape(shape[::-1]).T if by_columns else values
    return np.asarray(whole.ravel().astype(float))


def _from_text(path: Path, count: int) -> Array | int:
    """The numbers of a text file, or how many there are if they are not `count`.

    Blanks and line ends are between them, # begins a comment.
    """
    size = path.stat().st_size
    if size > _MOST_COMMENTS + _MOST_OF_VALUE * count:
        raise ValueError(f"{size:,} bytes of text")
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    words = [word for line in lines for word in line.split("#", 1)[0].split()]
    values = np.array([_real(word) for word in words])
    return values if len(values) == count else len(values)


def _real(word: str) -> float:
    if not word.isascii() or "_" in word:  # a number for Python alone
        raise ValueError(f"found {word[:40]!r}")
    return float(word)
