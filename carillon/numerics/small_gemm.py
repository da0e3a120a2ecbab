"""Products of a matrix with a narrow block of vectors, whose sums stay in registers.

BLAS copies the matrix into an order of its own before it multiplies, which is worth it where every
entry is used some hundred times.  A block of 32 vectors uses it 32 times: without the copy it takes
half the time.  Blocks are arrays of lanes (see `carillon.numerics.simd`), row by row, the vectors
of a row side by side and filled up with zeros.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from carillon.numerics.simd import compiler, empty, load_tile, store_tile, subtract_product
from carillon.numerics.simd_width import LANES, REGISTERS

Array = NDArray[np.float64]

compiled = compiler(Path(__file__))

ROWS, WIDE = (6, 4) if REGISTERS.number >= 32 else (4, 3)
"""Rows of a tile, and registers to a row at most: its sums stay in registers."""
DEPTH = 192
"""Products that are added to a tile before it is written back: so much of the block stays near."""
ROWS_NEAR = 16 * ROWS
"""Rows of the matrix that stay near while the block's columns are gone through."""


def lanes_of(width: int) -> int:
    """Registers that hold a row of `width` numbers."""
    return -(-width // LANES)


@compiled
def block(rows: int, lanes: int) -> Array:
    """Block of zeros with `lanes` registers to a row."""
    zeros = empty(rows * lanes)
    zeros[:] = 0.0
    return zeros


@compiled
def _strip(matrix, near, end, depth, right, result, column, wide):  # type: ignore[no-untyped-def]
    """A strip of the block, `wide` (a literal) registers wide, and some rows of the matrix."""
    entries, corner, down, along = matrix
    sums, place, lanes = result
    row = near
    while row + ROWS <= end:
        at = (sums, (place + row) * lanes + column, lanes, 1)
        left = (entries, corner + row * down, down, along)
        store_tile(at, subtract_product(load_tile(at, ROWS, wide), left, right, depth))
        row += ROWS
    while row < end:
        at = (sums, (place + row) * lanes + column, lanes, 1)
        left = (entries, corner + row * down, down, along)
        store_tile(at, subtract_product(load_tile(at, 1, wide), left, right, depth))
        row += 1


@compiled
def subtract(matrix, rows, depth, factor, result, start=0):  # type: ignore[no-untyped-def]
    """result -= matrix @ factor, from register `start` of every row on.

    Parameters
    ----------
    matrix
        (flat array, first entry, stride of rows, stride of columns), of doubles.
    rows, depth
        Its size.
    factor, result
        (block, first row, registers to a row).
    """
    entries, first, down, along = matrix
    block, top, lanes = factor
    for k in range(0, depth, DEPTH):
        few = min(DEPTH, depth - k)
        part = (entries, first + k * along, down, along)
        for near in range(0, rows, ROWS_NEAR):
            end = min(near + ROWS_NEAR, rows)
            column = start
            while column < lanes:
                wide = min(WIDE, lanes - column)
                right = (block, (top + k) * lanes + column, 1, lanes)
                if wide == 4:
                    _strip(part, near, end, few, right, result, column, 4)
                elif wide == 3:
                    _strip(part, near, end, few, right, result, column, 3)
                elif wide == 2:
                    _strip(part, near, end, few, right, result, column, 2)
                else:
                    _strip(part, near, end, few, right, result, column, 1)
                column += wide
