"""Moduli that reproduce the energies of given motions: the step all linear objectives share."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dataset_gen.element import Array
from dataset_gen.objectives.bounded import minimise_above
from dataset_gen.objectives.patterns import corner_strains

RIDGE = 1e-3
"""Pull towards E0, as a share of the mean diagonal of the normal matrix."""

REFERENCE_FLOOR = 1e-2
"""E0 is at least this share of the block's largest fine modulus."""

MODULUS_FLOOR = 1e-2
"""Lower bound of every coarse modulus, as a share of the block's largest fine modulus."""


class PatternFits(NamedTuple):
    """Coarse moduli (n, 8), relative residuals (n,) and convergence flags (n,) of one pattern."""

    moduli: Array
    residual: Array
    converged: NDArray[np.bool_]


class NormalEquations(NamedTuple):
    """`E^T matrix E - 2 vector^T E + constant`, one row per block: (n, 8, 8), (n, 8), (n,)."""

    matrix: Array
    vector: Array
    constant: Array


def energy_mismatch(motions: Array, energies: Array, poisson: float) -> NormalEquations:
    """Normal equations of `2 |D|_F^2 + tr(D)^2` with `D = sum_q E_q u^T K_q u - V`.

    This is the expected square of `g^T D g` for Gaussian mixtures g of the loads.

    Parameters
    ----------
    motions : (n, 24, m) corner displacements u of each load.
    energies : (n, m, m) fine energies V between the loads.
    """
    strains = corner_strains(poisson) @ motions
    count = len(strains)
    gram = strains @ strains.transpose(0, 2, 1)
    products = (gram * gram).reshape(count, 8, 6, 8, 6).sum(axis=(2, 4))
    traces = np.einsum("nii->ni", gram).reshape(count, 8, 6).sum(axis=2)
    loaded = ((strains @ energies) * strains).sum(axis=2).reshape(count, 8, 6).sum(axis=2)
    trace = np.einsum("nii->n", energies)
    return NormalEquations(
        2.0 * products + traces[:, :, None] * traces[:, None, :],
        2.0 * loaded + trace[:, None] * traces,
        2.0 * (energies * energies).sum(axis=(1, 2)) + trace**2,
    )


def reference_moduli(young: Array) -> Array:
    """E0 (n, 8): the fine moduli, raised to `REFERENCE_FLOOR` of the block's largest."""
    return np.maximum(young, REFERENCE_FLOOR * young.max(axis=1, keepdims=True))


def bounded_moduli(
    equations: NormalEquations, young: Array, reference: Array, ridge: float = RIDGE
) -> PatternFits:
    """Minimise the quadratic plus `ridge` towards `reference`, subject to the modulus floor."""
    matrix, vector, constant = equations
    weight = ridge * np.einsum("nii->n", matrix) / 8.0
    damped = matrix + weight[:, None, None] * np.eye(8)
    target = vector + weight[:, None] * reference
    lower = MODULUS_FLOOR * young.max(axis=1)
    moduli, settled = minimise_above(damped, target, lower)
    left = np.einsum("ni,nij,nj->n", moduli, matrix, moduli) - 2.0 * (vector * moduli).sum(axis=1)
    residual = np.sqrt(np.maximum(left + constant, 0.0) / constant)
    return PatternFits(moduli, residual, settled)
