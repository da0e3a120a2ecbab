"""Objective `chen2015`: energies at the block's corner displacements (Chen et al. 2015).

The block is loaded by Gaussian forces in self-equilibrium on all active nodes; the coarse element
takes over the displacements of the corners and shall store the same energy. A void corner has no
displacement; it continues the trilinear motion nearest to the active nodes.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from carillon.arrays import Array
from carillon.fem.block import CORNER_NODES, degrees_of_freedom
from carillon.numerics.simd import LANES, empty, spread, store
from carillon.processes.threads import blas_threads
from dataset_gen.objectives import flops
from dataset_gen.objectives.compiled import compiled
from dataset_gen.objectives.elimination import TILE, elimination_of
from dataset_gen.objectives.free_block import (
    FreeBlock,
    flexibility_norms,
    free_block_of,
    without_null,
)
from dataset_gen.objectives.kernel import (
    DENSE,
    LOWER,
    MOTIONS,
    WEIGHTS,
    all_forms,
    assemble,
    copy_in,
    factorise,
    form_sizes,
    lower_tiles,
    multiply,
    solve_lower,
    solve_upper,
    weigh,
    whiten,
    write_equations,
)
from dataset_gen.objectives.patterns import corner_strains, pattern_of, straining_motions
from dataset_gen.objectives.quadratic import (
    NormalEquations,
    PatternFits,
    bounded_moduli,
    form_equations,
)

WEIGHT = 0.02
"""Pull towards the fine moduli, as a share of the mean diagonal of the normal matrix."""


class Corners(NamedTuple):
    """Corners of a void pattern, on the active nodes in the order of elimination."""

    block: FreeBlock
    loads: Array
    """flat (a, 18): C^T Z: forces dual to the straining motions Z of the corners."""
    strains: Array
    """flat (48, 18): strains of the coarse element in its straining motions."""

    def flops(self) -> int:
        """Floating-point operations of one block's normal equations."""
        factor, stiffness, null = self.block
        size = 3 * len(factor.diagonal)
        small = flops.factorisation(DENSE) + 3 * flops.substitution(DENSE, MOTIONS)
        return (
            flops.assembly(stiffness)
            + flops.factorisation(factor)
            + 3 * flops.substitution(factor, MOTIONS)
            + 2 * flops.product(len(null) // size, MOTIONS, size)
            + 2 * flops.product(MOTIONS, MOTIONS, size)
            + small
            + flops.flexibility(factor, len(null) // size)
            + flops.normal_equations(MOTIONS)
        )


def corner_selection(mask: int, poisson: float) -> Array:
    """Matrix C (24, a) that reads the corners' displacements off the active nodes."""
    pattern = pattern_of(mask, poisson)
    selection = pattern.to_corners.copy()
    for row, dof in enumerate(degrees_of_freedom(CORNER_NODES)):
        position = np.flatnonzero(pattern.dofs == dof)
        if len(position):
            selection[row] = 0.0
            selection[row, position] = 1.0
    return selection


@cache
@blas_threads(1)
def corners_of(mask: int, poisson: float) -> Corners:
    """Tables of the pattern whose filled cells are the set bits of `mask` (1..255)."""
    pattern, motions = pattern_of(mask, poisson), straining_motions()
    loads = pattern.without_null(corner_selection(mask, poisson).T @ motions)
    order = pattern.positions(elimination_of(mask).dofs)
    strains = (corner_strains(poisson) @ motions).ravel()
    return Corners(free_block_of(mask, poisson), loads[order].ravel(), strains)


@compiled
def _form_equations(corners: Corners, young: Array, equations: NormalEquations) -> None:
    """Normal equations of the energy forms on all forces, K^+ C^T K_q C K^+ and K^+.

    The former live on the span of U = K^+ C^T Z. On orthonormal forces Q = U R^-T, with
    R R^T = U^T U, they are those of the motions R^T, and the latter is R^-1 U^T K^+ U R^-T, but for
    its trace and norm.
    """
    factor, stiffness, _ = corners.block
    size = 3 * len(factor.diagonal)
    weights, tiles, small = empty(WEIGHTS), empty(TILE * (len(stiffness.start) - 1)), empty(LOWER)
    u, motions, energies = empty(MOTIONS * size), empty(MOTIONS**2), empty(MOTIONS**2)
    off, on, last = form_sizes(MOTIONS)
    forms = empty(9 * last)
    for first in range(0, len(young), LANES):
        weigh(young, first, weights)
        assemble(stiffness, weights, tiles)
        copy_in(corners.loads, u)
        factorise(factor, tiles)
        solve_lower(factor, tiles, u, MOTIONS)
        solve_upper(factor, tiles, u, MOTIONS)
        without_null(corners.block, u, MOTIONS)
        columns = (u, 0, 1, MOTIONS)
        multiply(motions, columns, columns, MOTIONS, MOTIONS, size)
        solve_lower(factor, tiles, u, MOTIONS)
        multiply(energies, columns, columns, MOTIONS, MOTIONS, size)
        lower_tiles(motions, MOTIONS, small)
        factorise(DENSE, small)
        solve_lower(DENSE, small, motions, MOTIONS)
        whiten(small, energies)
        all_forms(motions, energies, MOTIONS, corners.strains, forms)
        trace, square = flexibility_norms(corners.block, tiles)
        store(forms, 9 * last - 1, trace)
        write_equations(forms, MOTIONS, first, equations)
        store(weights, 0, spread(2.0) * square + trace * trace)
        for row in range(first, min(first + LANES, len(young))):
            equations.constant[row] = weights[0, row - first]


def normal_equations(young: Array, mask: int, poisson: float) -> NormalEquations:
    """Normal equations of blocks (n, 8) that share one void pattern."""
    return form_equations(_form_equations, corners_of(mask, poisson), young)


def fit_pattern(young: Array, mask: int, poisson: float) -> PatternFits:
    """Fit blocks (n, 8) that share one void pattern."""
    return bounded_moduli(normal_equations(young, mask, poisson), young, young, WEIGHT)
