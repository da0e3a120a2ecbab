"""Parts of a cell's inside that touch nowhere in it, and where those of neighbours meet.

A cell is looked at through the small boxes that its lines stand for: a box is taken where a line
along any axis is inside there. So a wall of any thickness and direction takes boxes that hang
together, through corners at least, and walls two boxes apart are told from each other.
"""

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Index
from carillon.fem.finite_cells.basis import voxel_places
from carillon.fem.finite_cells.lines import CUT, FULL, Pieces

Labels = NDArray[np.int16]

BOXES = 8
"""Boxes along each edge of a voxel, each for some lines."""
SLIVER = 1e-4
"""Length [voxels] of a line's piece in a voxel below which it is taken to miss it."""


def find_parts(
    cells: Index, count: int, state: NDArray[np.int8], pieces: tuple[Pieces, ...]
) -> tuple[Labels, Index]:
    """Number the parts of each cell.

    Parameters
    ----------
    cells : (k, 3)
        Lowest voxels of the cells.
    count
        Voxels along an edge of a cell.
    state : (k, count^3)
        States of their voxels, x fastest, see `carillon.fem.finite_cells.lines`.
    pieces
        Of the lines along x, y and z.

    Returns
    -------
    labels : (k, b, b, b)
        Part of each of the ``b = count * BOXES`` boxes along an edge, numbered from 1 in each cell;
        0 outside.
    counts : (k,)
        Number of parts.
    """
    labels = np.zeros((len(cells), *(count * BOXES,) * 3), dtype=np.int16)
    for each, bounds in zip(pieces, box_bounds(pieces)):
        of_cells = cells, count, state, each.axis, each.lines
        _take_along(*of_cells, each.start, each.low, each.high, each.columns, bounds, labels)
    for voxel, corner in enumerate(BOXES * voxel_places(count)):
        x, y, z = (slice(start, start + BOXES) for start in corner)
        labels[state[:, voxel] == FULL, x, y, z] = -1
    counts = np.zeros(len(cells), dtype=np.int64)
    _number(labels, counts)
    return labels, counts


def meetings(lower: Index, upper: Index, labels: Labels, axis: int) -> Index:
    """Parts that meet at the faces between cells: rows (pair, part below, part above).

    `lower`, `upper` (p,): cells of `labels` on the two sides along the axis; -1 is one that is all
    inside.
    """
    found = _meetings(lower, upper, labels, axis)
    return np.array(found, dtype=np.int64).reshape(-1, 3)


def meetings_of_halves(
    whole: Index, half: Index, quarter: Index, labels: tuple[Labels, Labels], axis: int, side: int
) -> Index:
    """Parts that meet at faces of cells with cells of half the edge: rows (pair, part, its part).

    Parameters
    ----------
    whole, half : (p,)
        Cells of the two `labels`; -1 is one that is all inside.
    quarter : (p, 2)
        Half of the whole cell's face along each of the other axes that the smaller cell lies at.
    side
        Of the smaller cell that the face is on: 0, or 1 for the upper one.
    """
    found = _meetings_of_halves(whole, half, quarter, *labels, axis, side)
    return np.array(found, dtype=np.int64).reshape(-1, 3)


def box_bounds(pieces: tuple[Pieces, ...]) -> list[Array]:
    """Bounds (n, BOXES - 1) of the boxes in each voxel along x, y and z."""
    x, y, z = pieces
    every = x.lines // BOXES
    spreads = z.across[0], x.across[0], y.across[0]
    return [np.ascontiguousarray(spread.bounds[:, every - 1 :: every]) for spread in spreads]


@numba.njit(cache=True, nogil=True)
def _take_along(  # type: ignore[no-untyped-def]
    cells, count, state, axis, n, start, low, high, columns, bounds, labels
):
    boxes = BOXES
    b, c = (axis + 1) % 3, (axis + 2) % 3
    at, own = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    for k in range(len(cells)):
        for number_in in range(count**3):
            if state[k, number_in] != CUT:
                continue
            own[0], own[1] = number_in % count, number_in // count % count
            own[2] = number_in // count**2
            voxel = cells[k, axis] + own[axis]
            for i in range(n):
                for j in range(n):
                    row, column = (cells[k, b] + own[b]) * n + i, (cells[k, c] + own[c]) * n + j
                    line = row * columns + column
                    at[b] = own[b] * boxes + i * boxes // n
                    at[c] = own[c] * boxes + j * boxes // n
                    for number in range(start[line], start[line + 1]):
                        begin = max(low[number] - voxel, 0.0)
                        end = min(high[number] - voxel, 1.0)
                        if end - begin < SLIVER:
                            continue
                        first, last = 0, 0
                        while first < boxes - 1 and bounds[voxel, first] <= begin:
                            first += 1
                        while last < boxes - 1 and bounds[voxel, last] < end:
                            last += 1
                        for box in range(first, last + 1):
                            at[axis] = own[axis] * boxes + box
                            labels[k, at[0], at[1], at[2]] = -1


@numba.njit(cache=True, nogil=True)
def _number(labels, counts):  # type: ignore[no-untyped-def]
    """Number what hangs together among the boxes that are -1."""
    size = labels.shape[1]
    stack = np.empty((size**3, 3), dtype=np.int16)
    for k in range(len(labels)):
        boxes = labels[k]
        for x in range(size):
            for y in range(size):
                for z in range(size):
                    if boxes[x, y, z] != -1:
                        continue
                    counts[k] += 1
                    boxes[x, y, z] = counts[k]
                    stack[0, 0], stack[0, 1], stack[0, 2] = x, y, z
                    top = 1
                    while top:
                        top -= 1
                        p, q, r = stack[top, 0], stack[top, 1], stack[top, 2]
                        for i in range(max(p - 1, 0), min(p + 2, size)):
                            for j in range(max(q - 1, 0), min(q + 2, size)):
                                for m in range(max(r - 1, 0), min(r + 2, size)):
                                    if boxes[i, j, m] == -1:
                                        boxes[i, j, m] = counts[k]
                                        stack[top, 0], stack[top, 1], stack[top, 2] = i, j, m
                                        top += 1


@numba.njit(cache=True, nogil=True)
def _meetings(lower, upper, labels, axis):  # type: ignore[no-untyped-def]
    size = labels.shape[1]
    found = [(0, 0, 0)][:0]
    below = np.empty((size, size), dtype=np.int64)
    above = np.empty((size, size), dtype=np.int64)
    for pair in range(len(lower)):
        _face(labels, lower[pair], axis, size - 1, below)
        _face(labels, upper[pair], axis, 0, above)
        _meet(pair, below, above, found)
    return found


@numba.njit(cache=True, nogil=True)
def _meetings_of_halves(  # type: ignore[no-untyped-def]
    whole, half, quarter, whole_labels, half_labels, axis, side
):
    larger, size = whole_labels.shape[1], half_labels.shape[1]
    found = [(0, 0, 0)][:0]
    face = np.empty((larger, larger), dtype=np.int64)
    one = np.empty((size, size), dtype=np.int64)
    other = np.empty((size, size), dtype=np.int64)
    for pair in range(len(whole)):
        _face(whole_labels, whole[pair], axis, 0 if side else larger - 1, face)
        _face(half_labels, half[pair], axis, size - 1 if side else 0, other)
        for i in range(size):
            for j in range(size):
                row, column = quarter[pair, 0] * size + i, quarter[pair, 1] * size + j
                one[i, j] = face[row * larger // (2 * size), column * larger // (2 * size)]
        _meet(pair, one, other, found)
    return found


@numba.njit(cache=True, nogil=True)
def _meet(pair, below, above, found):  # type: ignore[no-untyped-def]
    size = len(below)
    begin = len(found)
    for i in range(size):
        for j in range(size):
            if below[i, j] and above[i, j]:
                _note(found, begin, pair, below[i, j], above[i, j])
    # A thin wall askew may take boxes on the two sides that meet at edges only.
    straight = len(found)
    for i in range(size):
        for j in range(size):
            if not below[i, j]:
                continue
            for m in range(max(i - 1, 0), min(i + 2, size)):
                for q in range(max(j - 1, 0), min(j + 2, size)):
                    if not above[m, q]:
                        continue
                    alone_below, alone_above = True, True
                    for number in range(begin, straight):
                        alone_below = alone_below and found[number][1] != below[i, j]
                        alone_above = alone_above and found[number][2] != above[m, q]
                    if alone_below or alone_above:
                        _note(found, begin, pair, below[i, j], above[m, q])


@numba.njit(cache=True, nogil=True)
def _face(labels, cell, axis, layer, face):  # type: ignore[no-untyped-def]
    """Parts at a face of a cell; 1 all over it where the cell is all inside."""
    size = len(face)
    for i in range(size):
        for j in range(size):
            if cell < 0:
                face[i, j] = 1
            elif axis == 0:
                face[i, j] = labels[cell, layer, i, j]
            elif axis == 1:
                face[i, j] = labels[cell, i, layer, j]
            else:
                face[i, j] = labels[cell, i, j, layer]


@numba.njit(cache=True, nogil=True)
def _note(found, begin, pair, lower, upper):  # type: ignore[no-untyped-def]
    for number in range(begin, len(found)):
        if found[number][1] == lower and found[number][2] == upper:
            return
    found.append((pair, lower, upper))
