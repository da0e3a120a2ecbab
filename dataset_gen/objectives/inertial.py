"""Objective `inertial`: the block, free all round, under the inertia of trilinear motions."""

from __future__ import annotations

from functools import cache

import numpy as np

from dataset_gen.element import Array
from dataset_gen.objectives.patterns import pattern_of
from dataset_gen.objectives.quadratic import (
    PatternFits,
    bounded_moduli,
    energy_mismatch,
    reference_moduli,
)
from dataset_gen.serial import serial_blas


@cache
@serial_blas
def inertia_loads(mask: int, poisson: float) -> Array:
    """Loads F (a, 24): inertia of the mass-normalised trilinear motions, in self-equilibrium.

    `F = (I - R R^T) M_a P_a L^-T` with `L L^T = P_a^T M_a P_a`; where cells hinge, the part that
    would move the hinge is taken out as well, since no stiffness answers it.
    """
    pattern = pattern_of(mask, poisson)
    inertia = pattern.mass @ pattern.interpolation
    factor = np.linalg.cholesky(pattern.interpolation.T @ inertia)
    loads = np.linalg.solve(factor, inertia.T).T
    loads = loads - pattern.rigid @ (pattern.rigid.T @ loads)
    return pattern.without_null(loads)


def fit_pattern(young: Array, mask: int, poisson: float) -> PatternFits:
    """Fit blocks (n, 8) that share one void pattern."""
    pattern = pattern_of(mask, poisson)
    loads = inertia_loads(mask, poisson)
    displacements = np.linalg.solve(pattern.assemble(young), loads[None])
    energies = loads.T @ displacements
    motions = pattern.to_corners @ displacements
    return bounded_moduli(
        energy_mismatch(motions, energies, poisson), young, reference_moduli(young)
    )
