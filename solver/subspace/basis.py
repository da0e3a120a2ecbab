"""A mass-orthonormal basis that grows by blocks of vectors, each in one piece of memory."""

from pathlib import Path

import numpy as np

from carillon.arrays import Array
from carillon.numerics import small_gemm
from carillon.numerics.simd import compiler
from carillon.numerics.simd_width import LANES
from carillon.numerics.small_gemm import DEPTH, ROWS_NEAR, lanes_of, subtract
from carillon.processes.threads import in_parallel, split
from solver.assembly.system import System

compiled = compiler(Path(__file__), Path(small_gemm.__file__))

ROWS_COMBINED = 512
"""Number of rows of all blocks that are brought together for a product."""


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
        block, lanes = _as_lanes(vectors)
        height = self._count * self._width

        def part(start: int, stop: int) -> Array:
            sums = np.zeros((height * lanes, LANES))
            _add_inner(self._flat(), self._count, self._rows, block, lanes, start, stop, sums)
            return sums

        total = np.asarray(sum(in_parallel(part, self._ranges(DEPTH), self._threads)))
        total = total.reshape(height, -1)[self._columns, : vectors.shape[1]]
        return self._system.summed(np.ascontiguousarray(total))

    def remove(self, overlap: Array, vectors: Array) -> None:
        """Subtract the basis vectors times `overlap` (size, k) from `vectors` (local, k)."""
        block, lanes = _as_lanes(vectors)
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
        """Rows of each thread, in whole grains."""
        pieces = split(-(-self._rows // grain), self._threads, max(self._rows, 1))
        return [(grain * start, min(grain * stop, self._rows)) for start, stop in pieces]


def _as_lanes(vectors: Array) -> tuple[Array, int]:
    """The same rows as a block of lanes, a view if they fill the registers; registers to a row."""
    rows, columns = vectors.shape
    lanes = lanes_of(columns)
    if columns == lanes * LANES and vectors.flags.c_contiguous:
        return vectors.reshape(-1, LANES), lanes
    padded = np.zeros((rows, lanes * LANES))
    padded[:, :columns] = vectors
    return padded.reshape(-1, LANES), lanes


@compiled
def _add_inner(  # type: ignore[no-untyped-def]
    blocks, count, rows, vectors, lanes, start, stop, sums
):
    width = len(sums) // (lanes * count) if count else 0
    for first in range(start, stop, DEPTH):
        depth = min(DEPTH, stop - first)
        for number in range(count):
            entries = (blocks, (number * rows + first) * width, 1, width)
            result = (sums, number * width, lanes)
            subtract(entries, width, depth, (vectors, first, lanes), result)
    sums[:] = -sums


@compiled
def _subtract(  # type: ignore[no-untyped-def]
    blocks, count, rows, weights, lanes, start, stop, vectors
):
    width = len(weights) // (lanes * count) if count else 0
    for first in range(start, stop, ROWS_NEAR):
        height = min(ROWS_NEAR, stop - first)
        for number in range(count):
            entries = (blocks, (number * rows + first) * width, width, 1)
            factor = (weights, number * width, lanes)
            subtract(entries, height, width, factor, (vectors, first, lanes))
