"""The block free all round, on the active nodes in the order of elimination.

Springs at just enough unknowns hold the motions without strain. Loads in self-equilibrium do not
strain them, so the answer is exact up to such a motion, and the stiffness stays sparse.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import qr

from carillon.arrays import Array
from carillon.fem.block import cell_stiffness
from carillon.fem.element import DEFAULT_POISSON
from carillon.numerics.simd import Vector, empty, load, spread, store
from carillon.processes.threads import blas_threads
from dataset_gen.objectives.compiled import compiled
from dataset_gen.objectives.elimination import (
    FactorStructure,
    Sum,
    elimination_of,
    lower_tiles_of,
    sum_of,
)
from dataset_gen.objectives.kernel import (
    COLUMNS,
    MEAN,
    copy_in,
    multiply,
    solve_lower,
    solve_upper,
    subtract_multiply,
)
from dataset_gen.objectives.patterns import pattern_of


class FreeBlock(NamedTuple):
    """Tables of a void pattern."""

    factor: FactorStructure
    stiffness: Sum
    """K with springs of the mean modulus."""
    null: Array
    """flat (a, k): orthonormal motions without strain, zero columns up to a multiple of six."""


@cache
@blas_threads(1)
def free_block_of(mask: int, poisson: float) -> FreeBlock:
    """Block of the pattern whose filled cells are the set bits of `mask` (1..255)."""
    cells = pattern_of(mask, poisson).cells
    return free_block_from(mask, [*cells, MEAN], cell_stiffness(poisson)[cells], poisson)


def free_block_from(
    mask: int, weights: list[int], stiffness: Array, poisson: float = DEFAULT_POISSON
) -> FreeBlock:
    """Block of the pattern `mask` from the numbers of its weights, that of the springs last.

    `stiffness` (w, 81, 81) is what each of the w others brings. Motions without strain are the same
    for every Poisson's ratio, but for rounding.
    """
    pattern, elimination = pattern_of(mask, poisson), elimination_of(mask)
    dofs = elimination.dofs
    null = pattern.null[pattern.positions(dofs)]
    held = qr(null.T, mode="r", pivoting=True)[1][: null.shape[1]]
    springs = np.zeros((1, len(dofs), len(dofs)))
    springs[0, held, held] = 1.0
    matrices = np.concatenate([stiffness[:, dofs[:, None], dofs], springs])
    tiles = lower_tiles_of(matrices, elimination.filled)
    padded = np.pad(null, ((0, 0), (0, -null.shape[1] % COLUMNS)))
    return FreeBlock(elimination.factor, sum_of(weights, tiles), padded.ravel())


@compiled
def without_null(block: FreeBlock, x: Array, columns: int) -> None:
    """Take the motions without strain out of x (a, columns)."""
    size = 3 * len(block.factor.diagonal)
    width = len(block.null) // size
    share = empty(width * columns)
    multiply(share, (block.null, 0, 1, width), (x, 0, 1, columns), width, columns, size)
    subtract_multiply(x, (block.null, 0, width, 1), (share, 0, 1, columns), size, columns, width)


@compiled
def squares(x: Array, start: int, stop: int) -> Vector:
    """Sum of the squares of x from entry `start` to `stop`, which differ by a multiple of six."""
    even, odd = spread(0.0), spread(0.0)
    for n in range(start, stop, 2):
        even = even + load(x, n) * load(x, n)
        odd = odd + load(x, n + 1) * load(x, n + 1)
    return even + odd


@compiled
def flexibility_norms(block: FreeBlock, tiles: Array) -> tuple[Vector, Vector]:
    """Trace and squared Frobenius norm of K^+ from the factor of K with springs.

    With G its inverse and P the projection away from the motions N without strain, K^+ = P G P.
    The columns of G are found two nodes at a time, and from the diagonal down only.
    """
    count = len(block.factor.diagonal)
    size = 3 * count
    width = len(block.null) // size
    x, moved, share = empty(COLUMNS * size), empty(width * size), empty(width * width)
    trace, square = spread(0.0), spread(0.0)
    for node in range(0, count, COLUMNS // 3):
        top, bottom = COLUMNS * 3 * node, COLUMNS * size
        below = min(top + COLUMNS * COLUMNS, bottom)
        for n in range(top, bottom):
            store(x, n, spread(0.0))
        for n in range(top, below, COLUMNS + 1):
            store(x, n, spread(1.0))
        solve_lower(block.factor, tiles, x, COLUMNS, node)
        solve_upper(block.factor, tiles, x, COLUMNS, node)
        for n in range(top, below, COLUMNS + 1):
            trace = trace + load(x, n)
        square = square + squares(x, top, below) + spread(2.0) * squares(x, below, bottom)
    copy_in(block.null, moved)
    solve_lower(block.factor, tiles, moved, width)
    solve_upper(block.factor, tiles, moved, width)
    multiply(share, (block.null, 0, 1, width), (moved, 0, 1, width), width, width, size)
    for n in range(0, width * width, width + 1):
        trace = trace - load(share, n)
    square = square - spread(2.0) * squares(moved, 0, width * size)
    return trace, square + squares(share, 0, width * width)
