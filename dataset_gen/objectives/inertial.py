"""Objective `inertial`: the block, free all round, under the inertia of trilinear motions."""

from functools import cache
from typing import NamedTuple

import numpy as np

from carillon.arrays import Array
from carillon.fem.element import DEFAULT_POISSON
from carillon.numerics.simd import LANES, empty
from carillon.processes.threads import blas_threads
from dataset_gen.objectives import flops
from dataset_gen.objectives.compiled import compiled
from dataset_gen.objectives.elimination import TILE, elimination_of
from dataset_gen.objectives.free_block import FreeBlock, free_block_of
from dataset_gen.objectives.kernel import (
    MOTIONS,
    WEIGHTS,
    all_forms,
    assemble,
    copy_in,
    factorise,
    form_sizes,
    multiply,
    solve_lower,
    solve_upper,
    symmetrise,
    weigh,
    write_equations,
)
from dataset_gen.objectives.patterns import corner_strains, pattern_of, straining_motions
from dataset_gen.objectives.quadratic import (
    NormalEquations,
    PatternFits,
    bounded_moduli,
    form_equations,
    reference_moduli,
)

LOADS = 24


class InertialTables(NamedTuple):
    """Loads of a void pattern, on the active nodes in the order of elimination."""

    block: FreeBlock
    loads: Array
    """flat (a, 24): inertial forces of the trilinear motions."""
    to_corners: Array
    """flat (18, a): straining motions nearest to nodal displacements."""
    strains: Array
    """flat (48, 18): strains of the coarse element in its straining motions."""

    def flops(self) -> int:
        """Floating-point operations of one block's normal equations."""
        factor, stiffness, _ = self.block
        size = 3 * len(factor.diagonal)
        return (
            flops.assembly(stiffness)
            + flops.factorisation(factor)
            + 2 * flops.substitution(factor, LOADS)
            + flops.product(LOADS, LOADS + MOTIONS, size)
            + flops.normal_equations(LOADS)
        )


@blas_threads(1)
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


@cache
@blas_threads(1)
def inertia_of(mask: int, poisson: float) -> InertialTables:
    """Tables of the pattern whose filled cells are the set bits of `mask` (1..255)."""
    return inertia_from(mask, free_block_of(mask, poisson), corner_strains(poisson), poisson)


def inertia_from(
    mask: int, block: FreeBlock, strains: Array, poisson: float = DEFAULT_POISSON
) -> InertialTables:
    """Tables of the pattern `mask`; `strains` (48, 24) are those from motions of the corners."""
    pattern = pattern_of(mask, poisson)
    order = pattern.positions(elimination_of(mask).dofs)
    motions = straining_motions()
    to_corners = pattern.without_null(pattern.to_corners.T @ motions).T
    return InertialTables(
        block=block,
        loads=inertia_loads(mask, poisson)[order].ravel(),
        to_corners=to_corners[:, order].ravel(),
        strains=(strains @ motions).ravel(),
    )


class InertialRoom(NamedTuple):
    """Room for the answer of a free block."""

    tiles: Array
    displacements: Array


@compiled
def inertial_room(inertia: InertialTables) -> InertialRoom:
    """Room for the answers of blocks with these tables."""
    factor, stiffness, _ = inertia.block
    return InertialRoom(
        empty(TILE * (len(stiffness.start) - 1)), empty(LOADS * 3 * len(factor.diagonal))
    )


@compiled
def inertial_response(
    inertia: InertialTables, weights: Array, room: InertialRoom, motions: Array, energies: Array
) -> None:
    """Straining motions (24, 18) of the corners under each load, and energies (24, 24)."""
    factor, stiffness, _ = inertia.block
    size = 3 * len(factor.diagonal)
    tiles, displacements = room
    assemble(stiffness, weights, tiles)
    copy_in(inertia.loads, displacements)
    factorise(factor, tiles)
    solve_lower(factor, tiles, displacements, LOADS)
    solve_upper(factor, tiles, displacements, LOADS)
    fields = (displacements, 0, 1, LOADS)
    multiply(energies, fields, (inertia.loads, 0, 1, LOADS), LOADS, LOADS, size)
    symmetrise(energies, LOADS, 0.5)
    multiply(motions, fields, (inertia.to_corners, 0, size, 1), LOADS, MOTIONS, size)


@compiled
def _form_equations(inertia: InertialTables, young: Array, equations: NormalEquations) -> None:
    weights, room = empty(WEIGHTS), inertial_room(inertia)
    energies, motions = empty(LOADS * LOADS), empty(LOADS * MOTIONS)
    forms = empty(9 * form_sizes(LOADS)[2])
    for first in range(0, len(young), LANES):
        weigh(young, first, weights)
        inertial_response(inertia, weights, room, motions, energies)
        all_forms(motions, energies, LOADS, inertia.strains, forms)
        write_equations(forms, LOADS, first, equations)


def normal_equations(young: Array, mask: int, poisson: float) -> NormalEquations:
    """Normal equations of blocks (n, 8) that share one void pattern."""
    return form_equations(_form_equations, inertia_of(mask, poisson), young)


def fit_pattern(young: Array, mask: int, poisson: float) -> PatternFits:
    """Fit blocks (n, 8) that share one void pattern."""
    equations = normal_equations(young, mask, poisson)
    return bounded_moduli(equations, young, reference_moduli(young))
