"""Which nodes share a cell."""

import numba
import numpy as np


@numba.njit(cache=True, nogil=True)
def graph_of_cells(cells, rows, width):  # type: ignore[no-untyped-def]
    """Compressed rows of which numbers below `width` share a cell, for the first `rows` of them.

    Returns (rows + 1,) offsets, the columns, which ascend within a row, and the entry (c, k, k) of
    every pair of numbers of the `cells` (c, k), -1 if there is none.
    """
    count, nodes = cells.shape
    first = np.zeros(rows + 1, dtype=np.int64)
    for cell in range(count):
        for a in range(nodes):
            if cells[cell, a] < rows:
                first[cells[cell, a] + 1] += 1
    first = np.cumsum(first)
    place = np.empty(first[-1], dtype=np.int64)
    filled = first[:-1].copy()
    for cell in range(count):
        for a in range(nodes):
            row = cells[cell, a]
            if row < rows:
                place[filled[row]] = cell * nodes + a
                filled[row] += 1
    indptr = np.zeros(rows + 1, dtype=np.int64)
    seen = np.full(width, -1, dtype=np.int64)
    for row in range(rows):
        indptr[row + 1] = indptr[row]
        for number in range(first[row], first[row + 1]):
            for column in cells[place[number] // nodes]:
                if column < width and seen[column] != row:
                    seen[column] = row
                    indptr[row + 1] += 1
    columns, at = np.empty(indptr[-1], dtype=np.int64), np.empty(width, dtype=np.int64)
    entry = np.full((count, nodes, nodes), -1, dtype=np.int32)
    seen[:] = -1
    for row in range(rows):
        end = indptr[row]
        for number in range(first[row], first[row + 1]):
            for column in cells[place[number] // nodes]:
                if column < width and seen[column] != row:
                    seen[column] = row
                    columns[end] = column
                    end += 1
        columns[indptr[row] : end].sort()
        for number in range(indptr[row], end):
            at[columns[number]] = number
        for number in range(first[row], first[row + 1]):
            cell, a = divmod(place[number], nodes)
            for b in range(nodes):
                if cells[cell, b] < width:
                    entry[cell, a, b] = at[cells[cell, b]]
    return indptr, columns, entry
