"""Objective `hybrid`: `oversampled` where all cells are filled, `inertial` where some are void.

A block inside the solid is held by its neighbours; one at a void surface moves freely there.
"""

from carillon.arrays import Array
from carillon.fem.block import ALL_FILLED
from dataset_gen.objectives import inertial, oversampled
from dataset_gen.objectives.quadratic import PatternFits


def fit_pattern(young: Array, mask: int, poisson: float) -> PatternFits:
    """Fit blocks (n, 8) that share one void pattern."""
    chosen = oversampled if mask == ALL_FILLED else inertial
    return chosen.fit_pattern(young, mask, poisson)
