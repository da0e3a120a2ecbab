"""Products of rows of small blocks with blocks of vectors, whose sums stay in registers.

A row of the result is gathered from the rows of a node's neighbours, for as many columns at a time
as registers hold: nothing is stored before it is complete. What a column comes to does not depend
on the columns beside it.
"""

from functools import cache
from pathlib import Path

import numpy as np
from numba import literally

from carillon.arrays import Array, Index
from carillon.numerics import small_gemm
from carillon.numerics.simd import add_gathered, compiler, sliding, store_tile, zeros
from carillon.numerics.simd_width import LANES
from carillon.numerics.small_gemm import WIDE

compiled = compiler(Path(__file__), Path(small_gemm.__file__))

STRIPS = (8, 4, 3, 2, 1)
"""Widths of a strip of columns, in registers."""
ROWS_NEAR = 128
"""Number of rows that are gone through for some of the columns before the next columns, so that
what these rows share stays in the cache."""


def multiply(
    rows: tuple[int, int],
    graph: tuple[Index, Index],
    blocks: Array,
    vectors: Array,
    ghosts: Array,
    result: Array,
    components: int = 1,
) -> None:
    """Rows [start, stop) of the product of a matrix of blocks with vectors.

    Parameters
    ----------
    rows
        Start and stop.
    graph
        Compressed rows: where each begins, and the columns. Those from the number of rows of
        `vectors` on count the ghosts.
    blocks : (e, b, b)
        Along the graph; b is 1 or 3.
    vectors, ghosts : (c b n, k), (c b g, k)
        Row-major, k at least `LANES`. The vectors may be columns of wider ones.
    result : (c b n, k)
        Of which the rows are written.
    components
        Number c of unknowns that each number of a block multiplies; more than one if b is 1.
    """
    width, size = vectors.shape[1], blocks.shape[1]
    stride, own = vectors.strides[0] // vectors.itemsize, len(vectors) // (size * components)
    near = np.lib.stride_tricks.as_strided(
        vectors, ((len(vectors) - 1) * stride + width,), vectors.strides[1:]
    )
    flat = [sliding(each) for each in (near, ghosts.reshape(-1), result.reshape(-1))]
    kernel, widest = (_multiply_scalars, 2 * WIDE) if size == 1 else (_multiply_blocks, WIDE)
    strips = _strips(width, stride, components, widest)
    widths = components * stride, components * width
    kernel(rows, own, *graph, blocks.reshape(-1), *flat, widths, strips)


@cache
def _strips(width: int, stride: int, components: int, widest: int) -> Index:
    """Strips that cover the columns of all components.

    Of each the first column in the vectors and in the result, and the number of registers. The last
    ones may go over columns once more, so that all registers are full.
    """
    if stride == width:
        width, stride, components = components * width, components * width, 1
    strips = []
    for component in range(components):
        column = 0
        while column < width:
            most = min(widest, -(-(width - column) // LANES), width // LANES)
            wide = max(each for each in STRIPS if each <= most)
            column = min(column, width - wide * LANES)
            strips.append((component * stride + column, component * width + column, wide))
            column += wide * LANES
    return np.array(strips)


@compiled
def _strip(  # type: ignore[no-untyped-def]
    rows, own, indptr, columns, blocks, vectors, ghosts, result, place, size, wide
):
    """Some rows of the result, `wide` registers of each; `size` and `wide` are literals."""
    start, stop = rows
    near_column, column, near_width, width = place
    near = (vectors, near_column, LANES, near_width, size * near_width)
    far = (ghosts, column - size * width * own, LANES, width, size * width)
    for row in range(start, stop):
        first, last = indptr[row], indptr[row + 1]
        middle = last
        while middle > first and columns[middle - 1] >= own:
            middle -= 1
        sums = add_gathered(zeros(size, wide), blocks, near, columns, (first, middle))
        if middle < last:
            sums = add_gathered(sums, blocks, far, columns, (middle, last))
        store_tile((result, size * row * width + column, width, LANES), sums)


@compiled
def _multiply(  # type: ignore[no-untyped-def]
    rows, own, indptr, columns, blocks, vectors, ghosts, result, widths, strips, size
):
    literally(size)
    for first in range(rows[0], rows[1], ROWS_NEAR):
        few = (first, min(first + ROWS_NEAR, rows[1]))
        for strip in range(len(strips)):
            place = (strips[strip, 0], strips[strip, 1], widths[0], widths[1])
            wide = strips[strip, 2]
            if wide == 8:
                _strip(few, own, indptr, columns, blocks, vectors, ghosts, result, place, size, 8)
            elif wide == 4:
                _strip(few, own, indptr, columns, blocks, vectors, ghosts, result, place, size, 4)
            elif wide == 3:
                _strip(few, own, indptr, columns, blocks, vectors, ghosts, result, place, size, 3)
            elif wide == 2:
                _strip(few, own, indptr, columns, blocks, vectors, ghosts, result, place, size, 2)
            else:
                _strip(few, own, indptr, columns, blocks, vectors, ghosts, result, place, size, 1)


@compiled
def _multiply_blocks(  # type: ignore[no-untyped-def]
    rows, own, indptr, columns, blocks, vectors, ghosts, result, widths, strips
):
    _multiply(rows, own, indptr, columns, blocks, vectors, ghosts, result, widths, strips, 3)


@compiled
def _multiply_scalars(  # type: ignore[no-untyped-def]
    rows, own, indptr, columns, blocks, vectors, ghosts, result, widths, strips
):
    _multiply(rows, own, indptr, columns, blocks, vectors, ghosts, result, widths, strips, 1)
