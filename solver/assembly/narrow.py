"""Products of narrow blocks of vectors that threads share, whose sums stay in registers."""

from pathlib import Path

import numpy as np

from carillon.arrays import Array
from carillon.numerics import small_gemm
from carillon.numerics.simd import compiler
from carillon.numerics.simd_width import LANES
from carillon.numerics.small_gemm import DEPTH, lanes_of, subtract
from carillon.processes.threads import in_parallel, split

compiled = compiler(Path(__file__), Path(small_gemm.__file__))

NARROW = 64
"""Columns of a narrow block at most: BLAS is faster for wider ones."""
ROWS_COMBINED = 512
"""Number of rows of a product that are made at once."""


def ranges(rows: int, threads: int, grain: int) -> list[tuple[int, int]]:
    """Half-open ranges of rows for each thread, in whole grains."""
    pieces = split(-(-rows // grain), threads, max(rows, 1))
    return [(grain * start, min(grain * stop, rows)) for start, stop in pieces]


def as_lanes(vectors: Array) -> tuple[Array, int]:
    """Vectors (n, k) as a block of lanes, and the number of registers to a row.

    The block is a view if the columns fill the registers.
    """
    rows, columns = vectors.shape
    lanes = lanes_of(columns)
    if columns == lanes * LANES and vectors.flags.c_contiguous:
        return vectors.reshape(-1, LANES), lanes
    padded = np.zeros((rows, lanes * LANES))
    padded[:, :columns] = vectors
    return padded.reshape(-1, LANES), lanes


def is_narrow(*blocks: Array) -> bool:
    """Whether these are row-major and narrow."""
    return all(each.flags.c_contiguous and 0 < each.shape[1] <= NARROW for each in blocks)


def inner(left: Array, right: Array, threads: int) -> Array:
    """left^T right (l, r) of narrow blocks (n, l) and (n, r)."""
    block, lanes = as_lanes(right)
    rows, width = left.shape

    def part(start: int, stop: int) -> Array:
        sums = np.zeros((width * lanes, LANES))
        add_inner(left.reshape(-1), 1, rows, block, lanes, start, stop, sums)
        return sums

    none = np.zeros((width * lanes, LANES))
    total = sum(in_parallel(part, ranges(rows, threads, DEPTH), threads), none)
    return np.ascontiguousarray(total.reshape(width, -1)[:, : right.shape[1]])


def combination(block: Array, weights: Array, threads: int) -> Array:
    """The columns of a narrow block (n, b) times `weights` (b, k)."""
    rows, columns = len(block), weights.shape[1]
    result = np.empty((rows, columns))

    def part(start: int, stop: int) -> None:
        for first in range(start, stop, ROWS_COMBINED):
            few = slice(first, min(first + ROWS_COMBINED, stop))
            result[few] = block[few] @ weights

    in_parallel(part, ranges(rows, threads, ROWS_COMBINED), threads)
    return result


@compiled
def add_inner(  # type: ignore[no-untyped-def]
    blocks, count, rows, vectors, lanes, start, stop, sums
):
    """Add to `sums` the products of `count` blocks with vectors, over the rows [start, stop).

    Parameters
    ----------
    blocks
        Flat (count, rows, width).
    vectors, lanes
        Block of lanes, and registers to a row.
    sums
        Zeros, (count width lanes, LANES).
    """
    width = len(sums) // (lanes * count) if count else 0
    for first in range(start, stop, DEPTH):
        depth = min(DEPTH, stop - first)
        for number in range(count):
            entries = (blocks, (number * rows + first) * width, 1, width)
            result = (sums, number * width, lanes)
            subtract(entries, width, depth, (vectors, first, lanes), result)
    sums[:] = -sums
