"""Products with the matrix of the cells, whose entry is -1 for each neighbour.

Along a line of the grid cells follow each other, and so do their neighbours on other lines.  Such a
run of cells is one sum of slices, which takes some instructions of the processor for many cells,
and asks once who the neighbours are.  Every row is added up in the order of its columns.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from carillon.arrays import Array, Index

SHORTEST = 12
"""Fewest cells of a run; of fewer every cell asks for its neighbours."""
SIDES = 3
"""Most neighbours before, and behind, a cell of a run."""

Rough = NDArray[np.float32]

compiled: Any = numba.njit(cache=True, nogil=True)


class CellRows:
    """Rows of a matrix (m, m) with -1 for each neighbour of a cell, beside the diagonal.

    Vectors that it is applied to are `padded`: zeros follow, in place of neighbours that a cell has
    not got.
    """

    def __init__(self, matrix: sp.csr_matrix) -> None:
        count = matrix.shape[0]
        row, column = np.repeat(np.arange(count), np.diff(matrix.indptr)), matrix.indices
        lower, upper = (
            _side_by_side(row[chosen], column[chosen], count)
            for chosen in (column < row, column > row)
        )
        diagonal = matrix.diagonal()
        begin, end = _runs(np.concatenate([lower, upper]), diagonal, count)
        is_long = (end - begin >= SHORTEST) & (lower[SIDES:, begin] == count).all(axis=0)
        is_long &= (upper[SIDES:, begin] == count).all(axis=0)
        begin, end = begin[is_long], end[is_long]
        self._tail = max(1, int((end - begin).max(initial=0)))
        near = np.concatenate([lower[:SIDES, begin], upper[:SIDES, begin]])
        edges = np.zeros(count + 1, dtype=np.int8)
        edges[begin] += 1
        edges[end] -= 1
        others = np.flatnonzero(np.cumsum(edges[:-1]) == 0).astype(np.uint32)
        # Unsigned, which spares the question whether an index is negative.
        runs = (each.astype(np.uint64) for each in (begin, end, near.T.copy()))
        self._places = *runs, others, tuple(lower), tuple(upper)
        self._diagonal, self._rough_diagonal = diagonal, diagonal.astype(np.float32)

    def padded(self, vector: NDArray[Any]) -> NDArray[Any]:
        """A vector (m,) and the zeros behind it."""
        return np.append(vector, np.zeros(self._tail, dtype=vector.dtype))

    def multiply(self, vector: Array, product: Array) -> None:
        """The `product` (m,) with a padded vector."""
        _multiply(*self._places, self._diagonal, vector, product)

    def subtract(self, vector: Rough, rhs: Rough, residual: Rough) -> None:
        """The `residual` (m,): the right-hand side minus the product with a padded vector."""
        _subtract(*self._places, self._rough_diagonal, vector, rhs, residual)

    def smooth(self, vector: Rough, rhs: Rough, scale: Rough, smoothed: Rough) -> None:
        """A padded vector `smoothed`: another plus `scale` (m,) times its residual."""
        _smooth(*self._places, self._rough_diagonal, vector, rhs, scale, smoothed)


def _side_by_side(row: Index, column: Index, count: int) -> NDArray[np.uint32]:
    """First, second, ... column (k, m) of each row, k >= `SIDES`; `count` where it has no more.

    `row` (e,) is ascending, and has `column` (e,).
    """
    length = np.bincount(row, minlength=count)
    columns = np.full((max(SIDES, length.max()), count), count, dtype=np.uint32)
    columns[np.arange(len(row)) - (np.cumsum(length) - length)[row], row] = column
    return columns


def _runs(near: NDArray[np.uint32], diagonal: Array, count: int) -> tuple[Index, Index]:
    """Where runs begin and end: neighbours of the next cell are next to those of the one before."""
    before, behind = near[:, :-1], near[:, 1:]
    goes_on = (behind == before + 1) & (behind < count) | (behind == count) & (before == count)
    breaks = np.flatnonzero(~goes_on.all(axis=0) | (diagonal[1:] != diagonal[:-1])) + 1
    return np.append(0, breaks), np.append(breaks, count)


# Rows are those of the runs [begin, end), whose first cells have the neighbours `near` (runs, 6),
# and others one by one, whose neighbours are `lower` and `upper`.


@numba.njit(inline="always")
def _slices(near, length, vector):  # type: ignore[no-untyped-def]
    """Values (length,) at the six neighbours of a run's cells, zeros where there is none."""
    return (
        vector[near[0] : near[0] + length],
        vector[near[1] : near[1] + length],
        vector[near[2] : near[2] + length],
        vector[near[3] : near[3] + length],
        vector[near[4] : near[4] + length],
        vector[near[5] : near[5] + length],
    )


@numba.njit(inline="always")
def _of_run(cell, slices, diagonal, own):  # type: ignore[no-untyped-def]
    a, b, c, d, e, f = slices
    before = -a[cell] - b[cell] - c[cell]
    return before + diagonal * own[cell] - d[cell] - e[cell] - f[cell]


@numba.njit(inline="always")
def _of_row(row, lower, upper, diagonal, vector):  # type: ignore[no-untyped-def]
    total = diagonal.dtype.type(0.0)
    for near in numba.literal_unroll(lower):
        total -= vector[near[row]]
    total += diagonal[row] * vector[row]
    for near in numba.literal_unroll(upper):
        total -= vector[near[row]]
    return total


@compiled
def _multiply(  # type: ignore[no-untyped-def]
    begin, end, near, others, lower, upper, diagonal, vector, product
):
    for run in range(np.uint64(len(begin))):
        first, length = begin[run], end[run] - begin[run]
        slices = _slices(near[run], length, vector)
        own, result = vector[first : first + length], product[first : first + length]
        of_run = diagonal[first]
        for cell in range(length):
            result[cell] = _of_run(cell, slices, of_run, own)
    for place in range(np.uint64(len(others))):
        row = np.uint64(others[place])
        product[row] = _of_row(row, lower, upper, diagonal, vector)


@compiled
def _subtract(  # type: ignore[no-untyped-def]
    begin, end, near, others, lower, upper, diagonal, vector, rhs, residual
):
    for run in range(np.uint64(len(begin))):
        first, length = begin[run], end[run] - begin[run]
        slices = _slices(near[run], length, vector)
        own, result = vector[first : first + length], residual[first : first + length]
        of_run, right = diagonal[first], rhs[first : first + length]
        for cell in range(length):
            result[cell] = right[cell] - _of_run(cell, slices, of_run, own)
    for place in range(np.uint64(len(others))):
        row = np.uint64(others[place])
        residual[row] = rhs[row] - _of_row(row, lower, upper, diagonal, vector)


@compiled
def _smooth(  # type: ignore[no-untyped-def]
    begin, end, near, others, lower, upper, diagonal, vector, rhs, scale, smoothed
):
    for run in range(np.uint64(len(begin))):
        first, length = begin[run], end[run] - begin[run]
        slices = _slices(near[run], length, vector)
        own, result = vector[first : first + length], smoothed[first : first + length]
        of_run, right, factor = diagonal[first], rhs[first : first + length], scale[first]
        for cell in range(length):
            left = right[cell] - _of_run(cell, slices, of_run, own)
            result[cell] = own[cell] + factor * left
    for place in range(np.uint64(len(others))):
        row = np.uint64(others[place])
        left = rhs[row] - _of_row(row, lower, upper, diagonal, vector)
        smoothed[row] = vector[row] + scale[row] * left
