"""The fit of blocks whose cells have any elasticity: objective `hybrid` for general cells.

Block and element are those of `hybrid`, but every cell has an elasticity matrix C_j of its own, and
the element of edge 2h is

    K_c = 2 h sum_q s_q B_q^T C_q B_q / 8

with the matrix C_q of the cell in the octant q. The fit finds the eight factors s_q.

What the kernels assemble is linear in the 21 numbers of each matrix, as it is in one modulus. The
pull towards the fine moduli and the bounds of `quadratic` go by the `stiffness_size` of matrices.
"""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from carillon.arrays import Array, Flags, Index
from carillon.errors import UserError
from carillon.fem.block import (
    ALL_FILLED,
    CELL_NODES,
    COARSE_EDGE,
    degrees_of_freedom,
    pattern_images,
    symmetries,
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
    turned,
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
from dataset_gen.objectives.patterns import pattern_of
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


class ScaleFits(NamedTuple):
    """Result of `fit_blocks`."""

    scales: Array
    """(n, 8) factors s on the octants' elasticity matrices, positive."""
    residual: Array
    """(n,) root of the objective relative to its value for s = 0."""
    converged: Flags
    """(n,) whether the minimiser settled."""


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
    held, loads, own = (
        each[cells].reshape(-1, *each.shape[2:]) for each in _patch_matrices()
    )
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
    """Numbers (n, k) of the blocks from row `first` on; the last block fills lanes that are left."""
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


def _fit(kernel: Kernel[Tables], tables: Tables, elasticity: Array, size: Array) -> PatternFits:
    """Moduli in the unit of `size` (n, 8), 0 where void, on matrices (n, 8, 6, 6) of size 1.

    The matrices at void octants are those of the coarse element there.
    """
    rows = len(size)
    numbers = elasticity[..., ROW, COLUMN]
    roots = np.linalg.cholesky(elasticity)[..., ROW, COLUMN]
    weights = np.empty((rows, WEIGHTS))
    weights[:, :SPRING] = (numbers * size[..., None]).reshape(rows, -1)
    weights[:, SPRING] = filled_mean(size, size > 0.0)
    equations = NormalEquations(np.empty((rows, 8, 8)), np.empty((rows, 8)), np.empty(rows))
    kernel(tables, weights, roots.reshape(rows, -1), equations)
    return bounded_moduli(equations, size, reference_moduli(size))


def fit_held(elasticity: Array, size: Array, mask: int) -> PatternFits:
    """Fit of blocks of one void pattern as `oversampled` does, see `_fit`."""
    return _fit(_held_equations, patch_tables(mask), elasticity, size)


def fit_free(elasticity: Array, size: Array, mask: int) -> PatternFits:
    """Fit of blocks of one void pattern as `inertial` does, see `_fit`."""
    return _fit(_free_equations, inertia_tables(mask), elasticity, size)


def fit_pattern(elasticity: Array, size: Array, mask: int) -> PatternFits:
    """Fit of blocks of one void pattern as `hybrid` does, see `_fit`."""
    chosen = fit_held if mask == ALL_FILLED else fit_free
    return chosen(elasticity, size, mask)


def _require_blocks(elasticity: Array, filled: Flags) -> None:
    if filled.ndim != 2 or filled.shape[1] != 8:
        raise UserError(f"filled cells have shape {filled.shape}, expected (n, 8)")
    if elasticity.shape != (*filled.shape, 6, 6):
        raise UserError(
            f"elasticity matrices have shape {elasticity.shape}, expected {(*filled.shape, 6, 6)}"
        )
    empty_blocks = np.flatnonzero(~filled.any(axis=1))
    if len(empty_blocks):
        raise UserError(f"block {empty_blocks[0]} is void in all eight cells: nothing to fit")
    if not np.isfinite(elasticity).all():
        raise UserError("elasticity matrices must be finite")


def _unit_elasticity(elasticity: Array, filled: Flags) -> tuple[Array, Array]:
    """Matrices (n, 8, 6, 6) of size 1, and the size (n, 8) of those given [Pa].

    Where a void octant has zeros it takes the mean of the filled cells.
    """
    nothing = ~filled & ~elasticity.any(axis=(2, 3))
    mean = filled_mean(elasticity, filled)[:, None]
    laws = np.where(nothing[..., None, None], mean, elasticity)
    size = stiffness_size(laws)
    with np.errstate(divide="ignore", invalid="ignore"):
        unit = laws / size[..., None, None]
    return unit, size


def fit_blocks(elasticity: ArrayLike, filled: ArrayLike) -> ScaleFits:
    """Fit the coarse elements of many blocks.

    Raises UserError for bad shapes, a block without filled cells, a matrix that is not positive
    definite.

    Parameters
    ----------
    elasticity : (n, 8, 6, 6)
        Elasticity matrix of each cell [Pa], symmetric. At a void octant it is the one that the
        coarse element has there; zeros stand for the mean of the filled cells.
    filled : (n, 8) bool
        Which cells are filled.

    Notes
    -----
    The scales do not change when all matrices of a block are multiplied by a number. A row's result
    does not depend on the other rows, bit for bit. One core is used.

    Examples
    --------
    >>> from carillon.fem.element import elasticity_matrix
    >>> fits = fit_blocks(np.tile(elasticity_matrix(0.3), (1, 8, 1, 1)), np.ones((1, 8)))
    >>> bool(np.allclose(fits.scales, fits.scales[0, 0])), bool(0.8 < fits.scales[0, 0] < 1.0)
    (True, True)
    """
    matrices, flags = np.asarray(elasticity, dtype=float), np.asarray(filled, dtype=bool)
    _require_blocks(matrices, flags)
    unit, size = _unit_elasticity(matrices, flags)
    try:
        np.linalg.cholesky(unit)
    except np.linalg.LinAlgError:
        raise UserError("an elasticity matrix is not positive definite") from None
    largest = np.where(flags, size, 0.0).max(axis=1, keepdims=True)
    masks = flags @ (1 << np.arange(8))
    images = pattern_images()
    symmetry = images.argmin(axis=1)[masks]
    least, turn = images.min(axis=1)[masks], symmetries()[symmetry]
    turned_size = np.empty_like(size)
    np.put_along_axis(turned_size, turn, np.where(flags, size / largest, 0.0), axis=1)
    turned_unit = np.empty_like(unit)
    np.put_along_axis(turned_unit, turn[..., None, None], turned(unit, symmetry), axis=1)
    moduli = np.empty_like(size)
    residual, converged = np.empty(len(size)), np.empty(len(size), dtype=bool)
    for mask in np.unique(least):
        rows = np.flatnonzero(least == mask)
        fits = fit_pattern(turned_unit[rows], turned_size[rows], int(mask))
        moduli[rows], residual[rows], converged[rows] = fits
    scales = np.take_along_axis(moduli, turn, axis=1) * (largest / size)
    return ScaleFits(scales, residual, converged)
