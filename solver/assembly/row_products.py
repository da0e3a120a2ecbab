"""Products of rows of small blocks with blocks of vectors, whose sums stay in registers.

A row of the result is gathered from the rows of a node's neighbours, for as many columns at a time
as registers hold: nothing is stored before it is complete. What a column comes to does not depend
on the columns beside it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from carillon import narrow
from carillon.lanes import add_gathered, compiler, sliding, store_tile, zeros
from carillon.narrow import WIDE
from carillon.registers import LANES

Array = NDArray[np.float64]
Index = NDArray[np.int64]

compiled = compiler(Path(__file__), Path(narrow.__file__))

ROWS_NEAR = 128
"""Rows that are gone through for some of the columns before the next columns are, so that what they
share with each other stays near."""


def multiply(
    rows: tuple[int, int],
    graph: tuple[Index, Index],
    blocks: Array,
    vectors: Array,
    ghosts: Array,
    result: Array,
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
    vectors, ghosts : (b n, k), (b g, k)
        Row-major, k at least `LANES`.
    result : (b n, k)
        Of which the rows are written.
    """
    width, size = vectors.shape[1], blocks.shape[1]
    flat = [sliding(each.reshape(-1)) for each in (vectors, ghosts, result)]
    kernel = _multiply_scalars if size == 1 else _multiply_blocks
    kernel(*rows, len(vectors) // size, *graph, blocks.reshape(-1), *flat, width)


@compiled
def _strip(  # type: ignore[no-untyped-def]
    rows, own, indptr, columns, blocks, vectors, ghosts, result, place, size, wide
):
    """Some rows of the result, `wide` registers of each; `size` and `wide` are literals."""
    start, stop = rows
    column, width = place
    near = (vectors, column, LANES, width, size * width)
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
def _multiply_blocks(  # type: ignore[no-untyped-def]
    start, stop, own, indptr, columns, blocks, vectors, ghosts, result, width
):
    for first in range(start, stop, ROWS_NEAR):
        rows = (first, min(first + ROWS_NEAR, stop))
        column = 0
        while column < width:
            # The last registers may go over columns once more, so that all are full.
            wide = min(WIDE, -(-(width - column) // LANES), width // LANES)
            column = min(column, width - wide * LANES)
            place = (column, width)
            if wide == 4:
                _strip(rows, own, indptr, columns, blocks, vectors, ghosts, result, place, 3, 4)
            elif wide == 3:
                _strip(rows, own, indptr, columns, blocks, vectors, ghosts, result, place, 3, 3)
            elif wide == 2:
                _strip(rows, own, indptr, columns, blocks, vectors, ghosts, result, place, 3, 2)
            else:
                _strip(rows, own, indptr, columns, blocks, vectors, ghosts, result, place, 3, 1)
            column += wide * LANES


@compiled
def _multiply_scalars(  # type: ignore[no-untyped-def]
    start, stop, own, indptr, columns, blocks, vectors, ghosts, result, width
):
    for first in range(start, stop, ROWS_NEAR):
        rows = (first, min(first + ROWS_NEAR, stop))
        column = 0
        while column < width:
            wide = min(2 * WIDE, -(-(width - column) // LANES), width // LANES)
            wide = 8 if wide >= 8 else 4 if wide >= 4 else min(wide, 2)
            column = min(column, width - wide * LANES)
            place = (column, width)
            if wide == 8:
                _strip(rows, own, indptr, columns, blocks, vectors, ghosts, result, place, 1, 8)
            elif wide == 4:
                _strip(rows, own, indptr, columns, blocks, vectors, ghosts, result, place, 1, 4)
            elif wide == 2:
                _strip(rows, own, indptr, columns, blocks, vectors, ghosts, result, place, 1, 2)
            else:
                _strip(rows, own, indptr, columns, blocks, vectors, ghosts, result, place, 1, 1)
            column += wide * LANES
