"""Objective `oversampled`: the block held by more of its own material.

The outer cells of a 4x4x4 patch repeat the nearest cell of the block in the middle, so each octant
of the patch has one modulus. Trilinear fields are prescribed on the patch's boundary; only the
block's own 27 nodes are free.
"""

from functools import cache
from typing import NamedTuple

import numpy as np

from carillon.arrays import Array, Index
from carillon.fem.block import COARSE_EDGE, NODES, cell_stiffness, degrees_of_freedom
from carillon.fem.element import CORNERS, DEFAULT_POISSON, shape_functions, uniform_stiffness
from carillon.numerics.simd import LANES, empty, spread
from carillon.processes.threads import blas_threads
from dataset_gen.objectives import flops
from dataset_gen.objectives.compiled import compiled
from dataset_gen.objectives.elimination import (
    TILE,
    FactorStructure,
    Links,
    Sum,
    elimination_of,
    lower_links,
    lower_tiles_of,
    sum_of,
)
from dataset_gen.objectives.kernel import (
    DENSE,
    LOWER,
    MOTIONS,
    WEIGHTS,
    add_diagonal,
    all_forms,
    assemble,
    factorise,
    form_sizes,
    lower_tiles,
    multiply,
    multiply_sparse,
    solve_lower,
    solve_upper,
    symmetrise,
    trace,
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
    reference_moduli,
)

RIGID_SHARE = 1e-8
"""Energy added to every field before whitening, as a share of all fields' energy.

Positive definite even for a single filled cell, which one prescribed field leaves rigid.
"""
PATCH_NODES = np.array([[x, y, z] for z in range(5) for y in range(5) for x in range(5)])


class Patch(NamedTuple):
    """The patch of a void pattern, on the active nodes in the order of elimination."""

    factor: FactorStructure
    held: Sum
    """Stiffness of the patch from each octant."""
    loads: Sum
    """(a, 18) loads of the prescribed fields from each octant."""
    links: Links
    own: Sum
    """Where and what the block's own stiffness is, half of it on the diagonal."""
    to_corners: Array
    """flat (18, a): straining motions nearest to nodal displacements."""
    strains: Array
    """flat (48, 18): strains of the coarse element in its straining motions."""

    def flops(self) -> int:
        """Floating-point operations of one block's normal equations."""
        size = 3 * len(self.factor.diagonal)
        whitening = flops.factorisation(DENSE) + 3 * flops.substitution(DENSE, MOTIONS)
        return (
            flops.assembly(self.held, self.loads, self.own)
            + flops.factorisation(self.factor)
            + 2 * flops.substitution(self.factor, MOTIONS)
            + flops.sparse_product(self.links, MOTIONS)
            + 2 * flops.product(MOTIONS, MOTIONS, size)
            + whitening
            + flops.normal_equations(MOTIONS)
        )


def octants_of(cell: Array) -> tuple[Array, Array]:
    """Stiffness (8, 81, 81) and load (8, 81, 18) on the block's nodes from each octant.

    `cell` (24, 24) is the stiffness of a fine cell.
    """
    block = degrees_of_freedom((NODES + 1) @ (1, 5, 25))
    boundary = np.setdiff1d(np.arange(3 * len(PATCH_NODES)), block)
    fields = np.kron(shape_functions((PATCH_NODES - 1) / COARSE_EDGE), np.eye(3))
    fields = fields @ straining_motions()
    stiffness, load = np.zeros((8, 81, 81)), np.zeros((8, 81, fields.shape[1]))
    for octant, origin in enumerate(CORNERS):
        whole = np.zeros((3 * len(PATCH_NODES),) * 2)
        for corner in 2 * origin + CORNERS:
            dofs = degrees_of_freedom((corner + CORNERS) @ (1, 5, 25))
            whole[np.ix_(dofs, dofs)] += cell
        stiffness[octant] = whole[np.ix_(block, block)]
        load[octant] = -whole[np.ix_(block, boundary)] @ fields[boundary]
    return stiffness, load


@cache
@blas_threads(1)
def octants(poisson: float) -> tuple[Array, Array]:
    """`octants_of` cells of unit modulus."""
    return octants_of(uniform_stiffness(poisson))


@cache
@blas_threads(1)
def patch_of(mask: int, poisson: float) -> Patch:
    """Patch of the pattern whose filled cells are the set bits of `mask` (1..255)."""
    cells = pattern_of(mask, poisson).cells
    matrices = (*octants(poisson), cell_stiffness(poisson))
    held, loads, own = (each[cells] for each in matrices)
    return patch_from(mask, cells, (held, loads, own), corner_strains(poisson))


def patch_from(
    mask: int, weights: Index, matrices: tuple[Array, Array, Array], strains: Array
) -> Patch:
    """Patch of the pattern `mask` from what each weight of a block brings.

    Parameters
    ----------
    weights : (w,)
        Numbers of the weights.
    matrices : (w, 81, 81), (w, 81, 18), (w, 81, 81)
        Stiffness of the patch, loads and stiffness of the block for each weight of one.
    strains : (48, 24)
        Strains of the coarse element from the motions of its corners.
    """
    pattern, elimination = pattern_of(mask, DEFAULT_POISSON), elimination_of(mask)
    dofs, motions = elimination.dofs, straining_motions()
    stiffness, load, block = matrices
    square = np.ix_(np.arange(len(weights)), dofs, dofs)
    own = lower_tiles_of(block[square], elimination.linked)
    links = lower_links(elimination.linked)
    own[:, links.tile[links.start[1:] - 1]] *= 0.5
    return Patch(
        factor=elimination.factor,
        held=sum_of(weights, lower_tiles_of(stiffness[square], elimination.filled)),
        loads=sum_of(weights, load[:, dofs].reshape(len(weights), -1, TILE)),
        links=links,
        own=sum_of(weights, own),
        to_corners=(motions.T @ pattern.to_corners[:, pattern.positions(dofs)]).ravel(),
        strains=(strains @ motions).ravel(),
    )


class PatchRoom(NamedTuple):
    """Room for the answer of a patch."""

    held: Array
    own: Array
    displacements: Array
    forces: Array


@compiled
def patch_room(patch: Patch) -> PatchRoom:
    """Room for the answers of patches with these tables."""
    size = 3 * len(patch.factor.diagonal)
    return PatchRoom(
        empty(TILE * (len(patch.held.start) - 1)),
        empty(TILE * (len(patch.own.start) - 1)),
        empty(MOTIONS * size),
        empty(MOTIONS * size),
    )


@compiled
def patch_response(
    patch: Patch, weights: Array, room: PatchRoom, motions: Array, energies: Array
) -> None:
    """Straining motions (18, 18) of the corners in each whitened field, energies (18, 18)."""
    size = 3 * len(patch.factor.diagonal)
    held, own, displacements, forces = room
    assemble(patch.held, weights, held)
    assemble(patch.loads, weights, displacements)
    assemble(patch.own, weights, own)
    factorise(patch.factor, held)
    solve_lower(patch.factor, held, displacements, MOTIONS)
    solve_upper(patch.factor, held, displacements, MOTIONS)
    # With half of K in `own`, u^T K u is half of K's part plus its transpose.
    multiply_sparse(patch.links, own, displacements, forces, MOTIONS)
    fields = (displacements, 0, 1, MOTIONS)
    multiply(energies, fields, (forces, 0, 1, MOTIONS), MOTIONS, MOTIONS, size)
    symmetrise(energies, MOTIONS, 1.0)
    multiply(motions, fields, (patch.to_corners, 0, size, 1), MOTIONS, MOTIONS, size)
    _whiten(energies, motions)


@compiled
def _form_equations(patch: Patch, young: Array, equations: NormalEquations) -> None:
    weights, room = empty(WEIGHTS), patch_room(patch)
    energies, motions = empty(MOTIONS * MOTIONS), empty(MOTIONS * MOTIONS)
    forms = empty(9 * form_sizes(MOTIONS)[2])
    for first in range(0, len(young), LANES):
        weigh(young, first, weights)
        patch_response(patch, weights, room, motions, energies)
        all_forms(motions, energies, MOTIONS, patch.strains, forms)
        write_equations(forms, MOTIONS, first, equations)


@compiled
def _whiten(energies: Array, motions: Array) -> None:
    """Combine the fields so that their energies are the unit matrix, but for `RIGID_SHARE`."""
    factor = empty(LOWER)
    more = trace(energies, MOTIONS) * spread(RIGID_SHARE)
    add_diagonal(energies, MOTIONS, more)
    lower_tiles(energies, MOTIONS, factor)
    add_diagonal(energies, MOTIONS, spread(0.0) - more)
    factorise(DENSE, factor)
    solve_lower(DENSE, factor, motions, MOTIONS)
    whiten(factor, energies)


def normal_equations(young: Array, mask: int, poisson: float) -> NormalEquations:
    """Normal equations of blocks (n, 8) that share one void pattern."""
    return form_equations(_form_equations, patch_of(mask, poisson), young)


def fit_pattern(young: Array, mask: int, poisson: float) -> PatternFits:
    """Fit blocks (n, 8) that share one void pattern."""
    equations = normal_equations(young, mask, poisson)
    return bounded_moduli(equations, young, reference_moduli(young))
