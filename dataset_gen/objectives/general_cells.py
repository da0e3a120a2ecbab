"""The fits `oversampled` and `inertial` for blocks whose cells have any elasticity.

What the kernels assemble is linear in the 21 numbers of each cell's elasticity matrix, as it is in
one modulus. The element is `h sum_q E_q B_q^T D_q B_q / 8`, with a matrix D_q for each octant. The
pull towards the fine moduli and the bounds of `quadratic` go by the `stiffness_size` of matrices.
"""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple, TypeVar

import numpy as np

from carillon.arrays import Array, Index
from carillon.fem.block import (
    ALL_FILLED,
    CELL_NODES,
    COARSE_EDGE,
    degrees_of_freedom,
)
from carillon.fem.element import GAUSS_POINTS, shape_gradients, strain_displacement
from carillon.numerics.simd import LANES, empty, load, spread, store
from carillon.processes.threads import blas_threads
from dataset_gen.objectives.compiled import compiled
from dataset_gen.objectives.elasticity import (
    COLUMN,
    NUMBERS,
    ROW,
    filled_mean,
    stiffness_size,
    unit_cells,
)
from dataset_gen.objectives.free_block import free_block_from
from dataset_gen.objectives.inertial import (
    LOADS,
    InertialTables,
    inertia_from,
    inertial_response,
    inertial_room,
)
from dataset_gen.objectives.kernel import (
    MOTIONS,
    STRAINS,
    element_forms,
    form_sizes,
    matrix_form,
    multiply,
    write_equations,
)
from dataset_gen.objectives.oversampled import (
    Patch,
    octants_of,
    patch_from,
    patch_response,
    patch_room,
)
from dataset_gen.objectives.quadratic import (
    NormalEquations,
    PatternFits,
    bounded_moduli,
    reference_moduli,
)

SPRING = 8 * NUMBERS
"""Number of the weight of springs; those before are the cells' matrices."""
WEIGHTS = SPRING + 1
"""How many weights a block has."""

Tables = TypeVar("Tables", Patch, InertialTables)
Kernel = Callable[[Tables, Array, Array, NormalEquations], None]


class GeneralBlocks(NamedTuple):
    """Blocks of one void pattern whose cells have any elasticity, and elements for them."""

    cells: Array
    """(n, 8, 6, 6) elasticity matrices of the cells, 0 where void."""
    basis: Array
    """(n, 8, 6, 6) matrices of the element's octants for a modulus of 1."""

    def take(self, rows: Index) -> "GeneralBlocks":
        """Some of the blocks."""
        return GeneralBlocks(self.cells[rows], self.basis[rows])


def _weights_of(cells: Index) -> Index:
    """Numbers of the weights of cells (f,), cell by cell."""
    return np.asarray((NUMBERS * cells[:, None] + np.arange(NUMBERS)).ravel())


@cache
@blas_threads(1)
def _patch_matrices() -> tuple[Array, Array, Array]:
    """Stiffness and load of patches, stiffness of blocks, from each number of each cell's matrix.

    Shapes (8, 21, 81, 81), (8, 21, 81, 18) and (8, 21, 81, 81).
    """
    pairs = [octants_of(cell) for cell in unit_cells()]
    own = np.zeros((8, NUMBERS, 81, 81))
    for cell, nodes in enumerate(CELL_NODES):
        dofs = degrees_of_freedom(nodes)
        own[cell][:, dofs[:, None], dofs] = unit_cells()
    held, loads = (np.stack(each, axis=1) for each in zip(*pairs))
    return held, loads, own


@cache
@blas_threads(1)
def _strains() -> Array:
    """Strains (48, 24) of the coarse element of edge 2 from motions of its corners.

    They are weighted so that the sum of their squares is the integral.
    """
    strain = strain_displacement(shape_gradients(GAUSS_POINTS))
    return np.asarray(np.sqrt(COARSE_EDGE / 8.0) * strain).reshape(STRAINS, 24)


@cache
@blas_threads(1)
def patch_tables(mask: int) -> Patch:
    """Patch of the pattern `mask`."""
    cells = np.flatnonzero(mask >> np.arange(8) & 1)
    held, loads, own = (each[cells].reshape(-1, *each.shape[2:]) for each in _patch_matrices())
    return patch_from(mask, _weights_of(cells), (held, loads, own), _strains())


@cache
@blas_threads(1)
def inertia_tables(mask: int) -> InertialTables:
    """Free block of the pattern `mask`, and its loads."""
    cells = np.flatnonzero(mask >> np.arange(8) & 1)
    stiffness = _patch_matrices()[2][cells].reshape(-1, 81, 81)
    weights = [*_weights_of(cells).tolist(), SPRING]
    return inertia_from(mask, free_block_from(mask, weights, stiffness), _strains())


@compiled
def _load_rows(rows: Array, first: int, lanes: Array) -> None:
    """Numbers (n, k) of blocks from row `first` on; the last block fills lanes that are left."""
    for lane in range(LANES):
        row = min(first + lane, len(rows) - 1)
        for n in range(rows.shape[1]):
            lanes[n, lane] = rows[row, n]


@compiled
def _strain_roots(strained: Array, fields: int, roots: Array) -> None:
    """Replace strains e (fields, 48) by L^T e, with the factors C = L L^T of the octants."""
    for at in range(0, fields * STRAINS, 6):
        root = NUMBERS * (at // 6 % 8)
        for i in range(6):
            total = spread(0.0)
            for j in range(i, 6):
                number = root + j * (j + 1) // 2 + i
                total = total + load(roots, number) * load(strained, at + j)
            store(strained, at + i, total)


@compiled
def _general_forms(
    motions: Array, energies: Array, fields: int, strains: Array, roots: Array, forms: Array
) -> None:
    """Forms of the octants and of the fine energies, see `kernel.all_forms`."""
    strained = empty(fields * STRAINS)
    multiply(strained, (motions, 0, MOTIONS, 1), (strains, 0, MOTIONS, 1), fields, STRAINS, MOTIONS)
    _strain_roots(strained, fields, roots)
    element_forms(strained, fields, forms)
    matrix_form(energies, fields, forms, 8)


@compiled
def _held_equations(patch: Patch, rows: Array, roots: Array, equations: NormalEquations) -> None:
    weights, factors, room = empty(WEIGHTS), empty(8 * NUMBERS), patch_room(patch)
    energies, motions = empty(MOTIONS * MOTIONS), empty(MOTIONS * MOTIONS)
    forms = empty(9 * form_sizes(MOTIONS)[2])
    for first in range(0, len(rows), LANES):
        _load_rows(rows, first, weights)
        _load_rows(roots, first, factors)
        patch_response(patch, weights, room, motions, energies)
        _general_forms(motions, energies, MOTIONS, patch.strains, factors, forms)
        write_equations(forms, MOTIONS, first, equations)


@compiled
def _free_equations(
    inertia: InertialTables, rows: Array, roots: Array, equations: NormalEquations
) -> None:
    weights, factors, room = empty(WEIGHTS), empty(8 * NUMBERS), inertial_room(inertia)
    energies, motions = empty(LOADS * LOADS), empty(LOADS * MOTIONS)
    forms = empty(9 * form_sizes(LOADS)[2])
    for first in range(0, len(rows), LANES):
        _load_rows(rows, first, weights)
        _load_rows(roots, first, factors)
        inertial_response(inertia, weights, room, motions, energies)
        _general_forms(motions, energies, LOADS, inertia.strains, factors, forms)
        write_equations(forms, LOADS, first, equations)


def _fit(kernel: Kernel[Tables], tables: Tables, blocks: GeneralBlocks) -> PatternFits:
    rows = len(blocks.cells)
    size = stiffness_size(blocks.cells)
    weights = np.empty((rows, WEIGHTS))
    weights[:, :SPRING] = blocks.cells[..., ROW, COLUMN].reshape(rows, -1)
    weights[:, SPRING] = filled_mean(size, size > 0.0)
    roots = np.linalg.cholesky(blocks.basis)[..., ROW, COLUMN].reshape(rows, -1)
    equations = NormalEquations(np.empty((rows, 8, 8)), np.empty((rows, 8)), np.empty(rows))
    kernel(tables, weights, roots, equations)
    return bounded_moduli(equations, size, reference_moduli(size))


def fit_held(blocks: GeneralBlocks, mask: int) -> PatternFits:
    """Moduli on the basis by the objective `oversampled`."""
    return _fit(_held_equations, patch_tables(mask), blocks)


def fit_free(blocks: GeneralBlocks, mask: int) -> PatternFits:
    """Moduli on the basis by the objective `inertial`."""
    return _fit(_free_equations, inertia_tables(mask), blocks)


def fit_hybrid(blocks: GeneralBlocks, mask: int) -> PatternFits:
    """Moduli on the basis by the objective `hybrid`."""
    return (fit_held if mask == ALL_FILLED else fit_free)(blocks, mask)
