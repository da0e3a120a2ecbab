"""A mass-orthonormal basis that grows by blocks of vectors, each in one piece of memory."""

from pathlib import Path

import numpy as np

from carillon.arrays import Array
from carillon.numerics import small_gemm
from carillon.numerics.simd import compiler, load_tile, store_tile, subtract_product
from carillon.numerics.simd_width import LANES
from carillon.numerics.small_gemm import DEPTH, ROWS, ROWS_NEAR, WIDE, lanes_of
from carillon.processes.threads import in_parallel
from solver.assembly.narrow import ROWS_COMBINED, add_inner, as_lanes, ranges
from solver.assembly.system import System

compiled = compiler(Path(__file__), Path(small_gemm.__file__))

BLOCKS_NEAR = 4
"""Number of blocks whose product with their weights is summed in registers: so many weights stay
near."""


class BlockBasis:
    """Vectors in blocks of up to `width` columns; other vectors are made orthogonal to them.

    Parameters
    ----------
    width
        Columns of a block at most.
    capacity
        Blocks that there is room for from the beginning.
    """

    def __init__(self, system: System, width: int, capacity: int) -> None:
        self._system = system
        self._rows = len(system.rigid)
        self._width = LANES * lanes_of(width)
        self._blocks = np.empty((capacity, self._rows, self._width))
        self._count = 0
        self._columns = np.empty(0, dtype=np.int64)

    @property
    def size(self) -> int:
        """Number of vectors."""
        return len(self._columns)

    def append(self, vectors: Array) -> None:
        """Add the columns of `vectors` (local, b), b up to the width."""
        columns = vectors.shape[1]
        if self._count == len(self._blocks):
            # Narrow blocks leave room unused.
            more = np.empty((1 + self._count // 2, *self._blocks.shape[1:]))
            self._blocks = np.concatenate([self._blocks, more])
        target = self._blocks[self._count]
        target[:, :columns] = vectors
        target[:, columns:] = 0.0
        first = self._count * self._width
        self._columns = np.concatenate([self._columns, np.arange(first, first + columns)])
        self._count += 1

    def inner(self, vectors: Array) -> Array:
        """Products (size, k) of all basis vectors with `vectors` (local, k); equal on all ranks."""
        if not self._count:
            return np.zeros((0, vectors.shape[1]))
        block, lanes = as_lanes(vectors)
        height = self._count * self._width

        def part(start: int, stop: int) -> Array:
            sums = np.zeros((height * lanes, LANES))
            add_inner(self._flat(), self._count, self._rows, block, lanes, start, stop, sums)
            return sums

        total = np.asarray(sum(in_parallel(part, self._ranges(DEPTH), self._threads)))
        total = total.reshape(height, -1)[self._columns, : vectors.shape[1]]
        return self._system.summed(np.ascontiguousarray(total))

    def remove(self, overlap: Array, vectors: Array) -> None:
        """Subtract the basis vectors times `overlap` (size, k) from `vectors` (local, k)."""
        if not self._count:
            return
        block, lanes = as_lanes(vectors)
        spread = np.zeros((self._count * self._width, lanes * LANES))
        spread[self._columns, : vectors.shape[1]] = overlap
        weights = spread.reshape(-1, LANES)

        def part(start: int, stop: int) -> None:
            _subtract(self._flat(), self._count, self._rows, weights, lanes, start, stop, block)

        in_parallel(part, self._ranges(ROWS_NEAR), self._threads)
        if not np.may_share_memory(block, vectors):
            vectors[:] = block.reshape(self._rows, -1)[:, : vectors.shape[1]]

    def combine(self, weights: Array, block: Array, of_block: Array) -> Array:
        """The basis vectors times `weights` (size, k), and a block (local, b) times its (b, k)."""
        spread = np.zeros((self._count * self._width, weights.shape[1]))
        spread[self._columns] = weights
        result = np.empty((self._rows, weights.shape[1]))

        def part(start: int, stop: int) -> None:
            for first in range(start, stop, ROWS_COMBINED):
                rows = slice(first, min(first + ROWS_COMBINED, stop))
                together = self._blocks[: self._count, rows].transpose(1, 0, 2)
                np.matmul(together.reshape(together.shape[0], -1), spread, out=result[rows])
                result[rows] += block[rows] @ of_block

        in_parallel(part, self._ranges(ROWS_COMBINED), self._threads)
        return result

    @property
    def _threads(self) -> int:
        return self._system.rows.threads

    def _flat(self) -> Array:
        return self._blocks.reshape(-1)

    def _ranges(self, grain: int) -> list[tuple[int, int]]:
        return ranges(self._rows, self._threads, grain)


@compiled
def _subtract(  # type: ignore[no-untyped-def]
    blocks, count, rows, weights, lanes, start, stop, vectors
):
    for first in range(start, stop, ROWS_NEAR):
        last = min(first + ROWS_NEAR, stop)
        for number in range(0, count, BLOCKS_NEAR):
            few = (number, min(number + BLOCKS_NEAR, count), count, rows)
            column = 0
            while column < lanes:
                wide = min(WIDE, lanes - column)
                if wide == 4:
                    _subtract_strip(blocks, few, weights, lanes, first, last, vectors, column, 4)
                elif wide == 3:
                    _subtract_strip(blocks, few, weights, lanes, first, last, vectors, column, 3)
                elif wide == 2:
                    _subtract_strip(blocks, few, weights, lanes, first, last, vectors, column, 2)
                else:
                    _subtract_strip(blocks, few, weights, lanes, first, last, vectors, column, 1)
                column += wide


@compiled
def _subtract_strip(  # type: ignore[no-untyped-def]
    blocks, few, weights, lanes, first, last, vectors, column, wide
):
    """Some blocks times their weights off some rows of `wide` (a literal) registers."""
    row = first
    while row + ROWS <= last:
        _subtract_tile(blocks, few, weights, lanes, row, vectors, column, ROWS, wide)
        row += ROWS
    while row < last:
        _subtract_tile(blocks, few, weights, lanes, row, vectors, column, 1, wide)
        row += 1


@compiled
def _subtract_tile(  # type: ignore[no-untyped-def]
    blocks, few, weights, lanes, row, vectors, column, high, wide
):
    begin, end, count, rows = few
    width = len(weights) // (lanes * count)
    at = (vectors, row * lanes + column, lanes, 1)
    sums = load_tile(at, high, wide)
    for number in range(begin, end):
        left = (blocks, (number * rows + row) * width, width, 1)
        right = (weights, number * width * lanes + column, 1, lanes)
        sums = subtract_product(sums, left, right, width)
    store_tile(at, sums)
