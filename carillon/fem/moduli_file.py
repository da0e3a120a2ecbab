"""Young's moduli from a file: one value [Pa] per voxel, checked before anything is allocated."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from carillon.errors import UserError
from carillon.fem.moduli import require_moduli

Array = NDArray[np.float64]

_HEADERS = {
    (1, 0): np.lib.format.read_array_header_1_0,
    (2, 0): np.lib.format.read_array_header_2_0,
}
_REAL = "fiu"
_MOST_COMMENTS, _MOST_OF_VALUE = 1 << 20, 64
"""Most bytes of comments in a text file of moduli, and of one value."""


def read_moduli(path: Path, count: int, label: str) -> Array:
    """Moduli (count,) [Pa] from a numpy `.npy` or text file.

    An array is not read unless it says itself that it holds so many real numbers.

    Parameters
    ----------
    label
        The mesh that they are for, in messages.

    Raises
    ------
    UserError
        If the file is unreadable, holds anything but real numbers or another number of them, or
        for values that are not finite, not positive or out of range.
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
