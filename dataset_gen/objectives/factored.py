"""Objective `factored`: the void pattern from `inertial`, the contrast from `oversampled`.

`E = E_inertial(1_p) E_oversampled(e) / E_oversampled(1_p)`, elementwise, with 1_p the block of unit
modulus and the same void pattern p. A block loaded by its own inertia answers void cells well, but
is too soft where materials differ, because in the mesh its neighbours hold it; held in a patch it
answers contrast well, but is too stiff where cells are void. Without void cells this is
`oversampled`, for one material `inertial`.
"""

from functools import cache

import numpy as np

from carillon.arrays import Array
from dataset_gen.objectives import hybrid, oversampled
from dataset_gen.objectives.quadratic import PatternFits


def unit_block(mask: int) -> Array:
    """1_p (1, 8): the block of unit modulus with the void pattern `mask`."""
    return (mask >> np.arange(8) & 1).astype(float)[None]


@cache
def unit_moduli(mask: int, poisson: float) -> Array:
    """Moduli (8,) of 1_p: `E_inertial(1_p)`, or `E_oversampled(1_p)` if all cells are filled."""
    return np.asarray(hybrid.fit_pattern(unit_block(mask), mask, poisson).moduli[0])


@cache
def held_unit_moduli(mask: int, poisson: float) -> Array:
    """`E_oversampled(1_p)` (8,)."""
    return np.asarray(oversampled.fit_pattern(unit_block(mask), mask, poisson).moduli[0])


@cache
def pattern_correction(mask: int, poisson: float) -> Array:
    """`E_inertial(1_p) / E_oversampled(1_p)` (8,) of the pattern `mask`; ones if all are filled."""
    return np.asarray(unit_moduli(mask, poisson) / held_unit_moduli(mask, poisson))


def fit_pattern(young: Array, mask: int, poisson: float) -> PatternFits:
    """Fit blocks (n, 8) that share one void pattern; the residual is that of `oversampled`."""
    held = oversampled.fit_pattern(young, mask, poisson)
    return held._replace(moduli=held.moduli * pattern_correction(mask, poisson))
