"""What the compiled fits share: sparse Cholesky, small products, normal equations, in lanes.

Every number stands for `LANES` blocks, one row of an array of lanes (see
`carillon.numerics.simd`). A matrix has its numbers row by row; operands of products are
tuples (array, first entry, stride, stride). The factorised matrices consist of 3x3 tiles in the
order of `dataset_gen.objectives.elimination`.
"""

import numpy as np

from carillon.arrays import Array
from carillon.numerics.simd import (
    LANES,
    Vector,
    add_product,
    empty,
    load,
    load_tile,
    root,
    scale_tile,
    spread,
    store,
    store_tile,
    subtract_product,
    zeros,
)
from dataset_gen.objectives.compiled import PANEL, compiled
from dataset_gen.objectives.elimination import TILE, FactorStructure, Links, Sum, factor_of

Operand = tuple[Array, int, int, int]
"""Array, first entry, stride along the rows or columns, stride along the sum."""
MOTIONS = 18
"""Straining motions of the coarse element: 24 less 6 rigid ones."""
STRAINS = 48
"""Strain components of the coarse element: six at each of eight quadrature points."""
COLUMNS = 6
"""Columns of right-hand sides come in multiples of so many, which panels divide evenly."""
MEAN, WEIGHTS = 8, 9
"""Weights of a block: the moduli 0..7, the mean of the filled cells'; how many there are."""
DENSE = factor_of(np.ones((MOTIONS // 3, MOTIONS // 3), dtype=bool))
"""Structure of the factor of a matrix on the straining motions, tiled as if these were nodes."""
LOWER = TILE * (MOTIONS // 3) * (MOTIONS // 3 + 1) // 2
"""Numbers of the lower tiles of such a matrix."""


@compiled
def weigh(young: Array, first: int, weights: Array) -> None:
    """Weights of the blocks from row `first` on; the last block fills the lanes that are left."""
    for lane in range(LANES):
        block = young[min(first + lane, len(young) - 1)]
        total, filled = 0.0, 0
        for cell in range(8):
            weights[cell, lane] = block[cell]
            total += block[cell]
            filled += block[cell] > 0.0
        weights[MEAN, lane] = total / filled


@compiled
def assemble(terms: Sum, weights: Array, tiles: Array) -> None:
    """Sum the fixed tiles of `terms`, each times its weight."""
    for n in range(len(terms.start) - 1):
        tile = zeros(9, 1)
        for term in range(terms.start[n], terms.start[n + 1]):
            fixed = (terms.values, TILE * term, 1, 0)
            tile = add_product(tile, fixed, (weights, terms.weight[term], 0, 0), 1)
        store_tile((tiles, TILE * n, 1, 0), tile)


@compiled
def _invert_root(tiles: Array, at: int) -> None:
    """Replace a tile on the diagonal, L L^T, by the lower triangle of L^-1."""
    one = spread(1.0)
    first = one / root(load(tiles, at))
    low = load(tiles, at + 3) * first
    last = load(tiles, at + 6) * first
    second = one / root(load(tiles, at + 4) - low * low)
    middle = (load(tiles, at + 7) - last * low) * second
    third = one / root(load(tiles, at + 8) - last * last - middle * middle)
    nothing = spread(0.0)
    corner = nothing - low * first * second
    store(tiles, at, first)
    store(tiles, at + 1, nothing)
    store(tiles, at + 2, nothing)
    store(tiles, at + 3, corner)
    store(tiles, at + 4, second)
    store(tiles, at + 5, nothing)
    store(tiles, at + 6, nothing - (last * first + middle * corner) * third)
    store(tiles, at + 7, nothing - middle * second * third)
    store(tiles, at + 8, third)


@compiled
def factorise(factor: FactorStructure, tiles: Array) -> None:
    """Replace a symmetric positive definite matrix by its Cholesky factor L.

    The tiles on the diagonal become those of L^-1.
    """
    below = factor.columns
    for k in range(len(factor.diagonal)):
        inverse = (tiles, TILE * factor.diagonal[k], 3, 1)
        _invert_root(tiles, TILE * factor.diagonal[k])
        for link in range(below.start[k], below.start[k + 1]):
            here = (tiles, TILE * below.tile[link], 3, 1)
            store_tile(here, add_product(zeros(3, 3), here, inverse, 3))
        for update in range(factor.start[k], factor.start[k + 1]):
            here = (tiles, TILE * factor.updated[update], 3, 1)
            left = (tiles, TILE * factor.left[update], 3, 1)
            right = (tiles, TILE * factor.right[update], 3, 1)
            store_tile(here, subtract_product(load_tile(here, 3, 3), left, right, 3))


@compiled
def solve_lower(
    factor: FactorStructure, tiles: Array, x: Array, columns: int, first: int = 0
) -> None:
    """Replace x (3 n, columns) by L^-1 x; with `first`, x is zero above that node and stays so."""
    rows = factor.rows
    for panel in range(0, columns, PANEL):
        for i in range(first, len(factor.diagonal)):
            at = 3 * i * columns + panel
            tile = load_tile((x, at, columns, 1), 3, PANEL)
            for link in range(rows.start[i], rows.start[i + 1]):
                if rows.node[link] < first:
                    continue
                left = (tiles, TILE * rows.tile[link], 3, 1)
                right = (x, 3 * rows.node[link] * columns + panel, 1, columns)
                tile = subtract_product(tile, left, right, 3)
            store_tile((x, at, columns, 1), tile)
            inverse = (tiles, TILE * factor.diagonal[i], 3, 1)
            tile = add_product(zeros(3, PANEL), inverse, (x, at, 1, columns), 3)
            store_tile((x, at, columns, 1), tile)


@compiled
def solve_upper(
    factor: FactorStructure, tiles: Array, x: Array, columns: int, first: int = 0
) -> None:
    """Replace x (3 n, columns) by L^-T x, from node `first` on."""
    below = factor.columns
    for panel in range(0, columns, PANEL):
        for i in range(len(factor.diagonal) - 1, first - 1, -1):
            at = 3 * i * columns + panel
            tile = load_tile((x, at, columns, 1), 3, PANEL)
            for link in range(below.start[i], below.start[i + 1]):
                left = (tiles, TILE * below.tile[link], 1, 3)
                right = (x, 3 * below.node[link] * columns + panel, 1, columns)
                tile = subtract_product(tile, left, right, 3)
            store_tile((x, at, columns, 1), tile)
            inverse = (tiles, TILE * factor.diagonal[i], 1, 3)
            tile = add_product(zeros(3, PANEL), inverse, (x, at, 1, columns), 3)
            store_tile((x, at, columns, 1), tile)


@compiled
def multiply_sparse(rows: Links, tiles: Array, x: Array, out: Array, columns: int) -> None:
    """Product of a matrix of linked tiles and x (3 n, columns)."""
    for panel in range(0, columns, PANEL):
        for i in range(len(rows.start) - 1):
            tile = zeros(3, PANEL)
            for link in range(rows.start[i], rows.start[i + 1]):
                left = (tiles, TILE * rows.tile[link], 3, 1)
                right = (x, 3 * rows.node[link] * columns + panel, 1, columns)
                tile = add_product(tile, left, right, 3)
            store_tile((out, 3 * i * columns + panel, columns, 1), tile)


@compiled
def multiply(
    out: Array, left: Operand, right: Operand, rows: int, columns: int, depth: int
) -> None:
    """Matrix `out` (rows, columns) = A B; strides of A: rows, depth; of B: columns, depth.

    Rows come in threes. A flat array is the same for all lanes.
    """
    for i in range(0, rows, 3):
        for j in range(0, columns, PANEL):
            tile = add_product(
                zeros(3, PANEL),
                (left[0], left[1] + i * left[2], left[2], left[3]),
                (right[0], right[1] + j * right[2], right[2], right[3]),
                depth,
            )
            store_tile((out, i * columns + j, columns, 1), tile)


@compiled
def subtract_multiply(
    out: Array, left: Operand, right: Operand, rows: int, columns: int, depth: int
) -> None:
    """Subtract A B from the matrix `out` (rows, columns); otherwise as `multiply`."""
    for i in range(0, rows, 3):
        for j in range(0, columns, PANEL):
            here = (out, i * columns + j, columns, 1)
            tile = subtract_product(
                load_tile(here, 3, PANEL),
                (left[0], left[1] + i * left[2], left[2], left[3]),
                (right[0], right[1] + j * right[2], right[2], right[3]),
                depth,
            )
            store_tile(here, tile)


@compiled
def symmetrise(matrix: Array, size: int, share: float) -> None:
    """Replace a square matrix A by `share` (A + A^T)."""
    factor = spread(share)
    for i in range(size):
        for j in range(i + 1):
            both = (load(matrix, size * i + j) + load(matrix, size * j + i)) * factor
            store(matrix, size * i + j, both)
            store(matrix, size * j + i, both)


@compiled
def transpose(matrix: Array, size: int) -> None:
    """Transpose a square matrix."""
    for i in range(size):
        for j in range(i):
            upper = load(matrix, size * j + i)
            store(matrix, size * j + i, load(matrix, size * i + j))
            store(matrix, size * i + j, upper)


@compiled
def copy_in(numbers: Array, out: Array) -> None:
    """Copy flat numbers into all lanes."""
    for n in range(len(numbers)):
        store(out, n, load(numbers, n))


@compiled
def trace(matrix: Array, size: int) -> Vector:
    """Trace of a square matrix."""
    total = spread(0.0)
    for i in range(size):
        total = total + load(matrix, (size + 1) * i)
    return total


@compiled
def add_diagonal(matrix: Array, size: int, value: Vector) -> None:
    """Add the same to the diagonal of a square matrix."""
    for i in range(size):
        store(matrix, (size + 1) * i, load(matrix, (size + 1) * i) + value)


@compiled
def lower_tiles(matrix: Array, size: int, tiles: Array) -> None:
    """Lower tiles, row by row, of a symmetric matrix."""
    n = 0
    for i in range(0, size, 3):
        for j in range(0, i + 3, 3):
            tile = load_tile((matrix, size * i + j, size, 1), 3, 3)
            store_tile((tiles, n, 3, 1), tile)
            n += TILE


@compiled
def whiten(factor: Array, energies: Array) -> None:
    """Replace symmetric `energies` (18, 18) by L^-1 E L^-T, L being the `factor` as tiles."""
    solve_lower(DENSE, factor, energies, MOTIONS)
    transpose(energies, MOTIONS)
    solve_lower(DENSE, factor, energies, MOTIONS)


# A symmetric form on the fields is kept as its tiles below the diagonal, then those on it, then its
# trace; nine forms stand one after the other, those of the quadrature points and the fine energies.


@compiled
def form_sizes(fields: int) -> tuple[int, int, int]:
    """Numbers of a form on so many fields: below the diagonal, on it, altogether."""
    nodes = fields // 3
    below = TILE * nodes * (nodes - 1) // 2
    return below, TILE * nodes, below + TILE * nodes + 1


@compiled
def _diagonal_sum(forms: Array, at: int) -> Vector:
    return load(forms, at) + load(forms, at + 4) + load(forms, at + 8)


@compiled
def matrix_form(matrix: Array, fields: int, forms: Array, row: int) -> None:
    """Write a symmetric matrix on the fields as a form."""
    off, _, size = form_sizes(fields)
    below, diagonal = size * row, size * row + off
    total = spread(0.0)
    for i in range(0, fields, 3):
        for j in range(0, i, 3):
            tile = load_tile((matrix, fields * i + j, fields, 1), 3, 3)
            store_tile((forms, below, 3, 1), tile)
            below += TILE
        tile = load_tile((matrix, (fields + 1) * i, fields, 1), 3, 3)
        store_tile((forms, diagonal, 3, 1), tile)
        total = total + _diagonal_sum(forms, diagonal)
        diagonal += TILE
    store(forms, size * row + size - 1, total)


@compiled
def element_forms(strains: Array, fields: int, forms: Array) -> None:
    """Write the energies at the quadrature points as the first eight forms.

    `strains` (fields, 48) are those of the coarse element in each field.
    """
    off, _, size = form_sizes(fields)
    for q in range(8):
        below, diagonal = size * q, size * q + off
        total = spread(0.0)
        for i in range(0, fields, 3):
            left = (strains, STRAINS * i + 6 * q, STRAINS, 1)
            for j in range(0, i, 3):
                right = (strains, STRAINS * j + 6 * q, STRAINS, 1)
                store_tile((forms, below, 3, 1), add_product(zeros(3, 3), left, right, 6))
                below += TILE
            store_tile((forms, diagonal, 3, 1), add_product(zeros(3, 3), left, left, 6))
            total = total + _diagonal_sum(forms, diagonal)
            diagonal += TILE
        store(forms, size * q + size - 1, total)


@compiled
def inner_products(forms: Array, fields: int, gram: Array) -> None:
    """Inner products `2 <A, B> + tr(A) tr(B)` of nine forms: lower tiles of gram (9, 9)."""
    off, on, size = form_sizes(fields)
    for i in range(0, 9, 3):
        for j in range(0, i + 3, 3):
            left, right = size * i, size * j
            tile = zeros(3, 3)
            tile = add_product(tile, (forms, left, size, 1), (forms, right, size, 1), off)
            tile = scale_tile(tile, 2.0)
            left, right = left + off, right + off
            tile = add_product(tile, (forms, left, size, 1), (forms, right, size, 1), on)
            tile = scale_tile(tile, 2.0)
            left, right = left + on, right + on
            tile = add_product(tile, (forms, left, size, 1), (forms, right, size, 1), 1)
            store_tile((gram, 9 * i + j, 9, 1), tile)


@compiled
def all_forms(motions: Array, energies: Array, fields: int, strains: Array, forms: Array) -> None:
    """Forms of the quadrature points and of the fine energies.

    Parameters
    ----------
    motions : (fields, 18)
        Straining motions of the corners in each field.
    energies : (fields, fields)
        Fine energies.
    strains : flat (48, 18)
        Strains of the straining motions.
    """
    strained = empty(fields * STRAINS)
    multiply(strained, (motions, 0, MOTIONS, 1), (strains, 0, MOTIONS, 1), fields, STRAINS, MOTIONS)
    element_forms(strained, fields, forms)
    matrix_form(energies, fields, forms, 8)


@compiled
def write_equations(
    forms: Array, fields: int, first: int, equations: tuple[Array, Array, Array]
) -> None:
    """Write the normal equations of the blocks from row `first` on: inner products of the forms."""
    gram = empty(81)
    inner_products(forms, fields, gram)
    matrix, vector, constant = equations
    for lane in range(min(LANES, len(constant) - first)):
        row = first + lane
        for p in range(8):
            for q in range(p + 1):
                matrix[row, p, q] = gram[9 * p + q, lane]
                matrix[row, q, p] = gram[9 * p + q, lane]
            vector[row, p] = gram[72 + p, lane]
        constant[row] = gram[80, lane]
