"""Young's moduli of a solid, one a cell or one a quadrature point: what may be given, what made."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from carillon.errors import UserError
from carillon.limits import LARGEST_CONTRAST, MODULI

Array = NDArray[np.float64]

POINTS = 8
"""Quadrature points of a cell."""
_REAL = "fiu"


def require_moduli(
    young: ArrayLike, cells: int, source: str = "moduli", points: bool = True
) -> Array:
    """Moduli [Pa] that a user gives, (cells,) or (cells, 8), as floats of the same shape.

    Without `points` those of quadrature points are refused.

    Raises
    ------
    UserError
        If they are of another shape, no real numbers, not finite, not positive, or beyond the
        limits of `carillon.limits`; `source` is where they are from.

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

    Raises
    ------
    UserError
        If they are of another shape, not finite, negative or all zero.
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
