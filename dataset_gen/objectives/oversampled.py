"""Objective `oversampled`: the block held by more of its own material.

The outer cells of a 4x4x4 patch repeat the nearest cell of the block in the middle, so each octant
of the patch has one modulus. Trilinear fields are prescribed on the patch's boundary; only the
block's own 27 nodes are free.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from dataset_gen.block import COARSE_EDGE, NODES, degrees_of_freedom
from dataset_gen.element import CORNERS, Array, shape_functions, uniform_stiffness
from dataset_gen.objectives.patterns import pattern_of, straining_motions
from dataset_gen.objectives.quadratic import (
    PatternFits,
    bounded_moduli,
    energy_mismatch,
    reference_moduli,
)
from dataset_gen.serial import serial_blas

RIGID_SHARE = 1e-8
"""Energy added to every field before whitening, as a share of all fields' energy."""

PATCH_NODES = np.array([[x, y, z] for z in range(5) for y in range(5) for x in range(5)])


@dataclass(frozen=True)
class Patch:
    """Matrices of the patch for unit moduli of one octant, on the block's active nodes.

    stiffness (f, a * a) and boundary load (f, a * 18) of each filled octant.
    """

    stiffness: Array
    load: Array


@cache
@serial_blas
def _octants(poisson: float) -> tuple[Array, Array]:
    """Stiffness (8, 81, 81) and load (8, 81, 18) on the block's nodes from each octant."""
    block = degrees_of_freedom((NODES + 1) @ (1, 5, 25))
    boundary = np.setdiff1d(np.arange(3 * len(PATCH_NODES)), block)
    fields = np.kron(shape_functions((PATCH_NODES - 1) / COARSE_EDGE), np.eye(3))
    fields = fields @ straining_motions()
    stiffness, load = np.zeros((8, 81, 81)), np.zeros((8, 81, fields.shape[1]))
    for octant, origin in enumerate(CORNERS):
        whole = np.zeros((3 * len(PATCH_NODES),) * 2)
        for cell in 2 * origin + CORNERS:
            dofs = degrees_of_freedom((cell + CORNERS) @ (1, 5, 25))
            whole[np.ix_(dofs, dofs)] += uniform_stiffness(poisson)
        stiffness[octant] = whole[np.ix_(block, block)]
        load[octant] = -whole[np.ix_(block, boundary)] @ fields[boundary]
    return stiffness, load


@cache
def patch_of(mask: int, poisson: float) -> Patch:
    """Patch matrices restricted to the active nodes of the pattern `mask`."""
    pattern = pattern_of(mask, poisson)
    stiffness, load = _octants(poisson)
    kept = stiffness[np.ix_(pattern.cells, pattern.dofs, pattern.dofs)]
    loads = load[np.ix_(pattern.cells, pattern.dofs)]
    count = len(pattern.cells)
    return Patch(
        np.ascontiguousarray(kept.reshape(count, -1)),
        np.ascontiguousarray(loads.reshape(count, -1)),
    )


def fit_pattern(young: Array, mask: int, poisson: float) -> PatternFits:
    """Fit blocks (n, 8) that share one void pattern."""
    pattern, patch = pattern_of(mask, poisson), patch_of(mask, poisson)
    size, count = len(pattern.dofs), len(young)
    filled = young[:, None, pattern.cells]
    held = (filled @ patch.stiffness).reshape(count, size, size)
    loads = (filled @ patch.load).reshape(count, size, -1)
    displacements = np.linalg.solve(held, loads)
    own = (filled @ pattern.stiffness).reshape(count, size, size)
    energies = displacements.transpose(0, 2, 1) @ (own @ displacements)
    factor = np.linalg.cholesky(_regularised(energies))
    motions = pattern.to_corners @ displacements
    whitened = _divided(motions.transpose(0, 2, 1), factor).transpose(0, 2, 1)
    half = _divided(energies, factor)
    unit = _divided(half.transpose(0, 2, 1), factor)
    return bounded_moduli(energy_mismatch(whitened, unit, poisson), young, reference_moduli(young))


def _regularised(energies: Array) -> Array:
    """Positive definite even for a single filled cell, which one prescribed field leaves rigid."""
    trace = np.einsum("nii->n", energies)[:, None, None]
    symmetric = 0.5 * (energies + energies.transpose(0, 2, 1))
    return np.asarray(symmetric + RIGID_SHARE * trace * np.eye(energies.shape[1]))


def _divided(rows: Array, factor: Array) -> Array:
    """`L^-1 B` for each Cholesky factor L (n, m, m) and B (n, m, k)."""
    return np.asarray(np.linalg.solve(factor, rows))
