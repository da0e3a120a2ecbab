"""Where lines along an axis cross a surface."""

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index


def line_crossings(
    vertices: Array,
    faces: Index,
    rows: Array,
    columns: Array,
    axis: int,
    requested: Flags | None = None,
) -> tuple[Index, Array, NDArray[np.int8]]:
    """Crossings of lines along an axis with the triangles of a surface.

    Triangles that share an edge agree on which side of it a line passes, so that a line through an
    edge crosses one of the two.

    Parameters
    ----------
    vertices : (v, 3)
        In any unit.
    faces : (f, 3)
        Triangles; two that meet have the same vertices there.
    rows, columns
        Ascending coordinates of the lines along axis + 1 and axis + 2, modulo 3: line (i, j) has
        the number ``i * len(columns) + j``.
    requested : (r, c)
        Which lines are looked at: one for as many rows and columns each as there are; all if None.

    Returns
    -------
    start : (lines + 1,)
        Range of each line's crossings.
    place : (k,)
        Ascending on each line.
    step : (k,) int8
        Change of the winding number there: 1 where the line enters a closed surface, -1 where it
        leaves.
    """
    points = np.ascontiguousarray(vertices[:, [(axis + 1) % 3, (axis + 2) % 3, axis]])
    counts = np.zeros(len(rows) * len(columns) + 1, dtype=np.int64)
    nothing = np.empty(0), np.empty(0, dtype=np.int8)
    if requested is None:
        requested = np.ones((1, 1), dtype=bool)
    every = len(rows) // requested.shape[0], len(columns) // requested.shape[1]
    lines = rows, columns, np.ascontiguousarray(requested), every
    _cross(points, faces, lines, counts[1:], *nothing, False)
    start = np.cumsum(counts)
    place, step = np.empty(start[-1]), np.empty(start[-1], dtype=np.int8)
    _cross(points, faces, lines, start[:-1].copy(), place, step, True)
    _sort(start, place, step)
    return start, place, step


@numba.njit(cache=True, nogil=True)
def _left(points, i, j, x, y):  # type: ignore[no-untyped-def]
    """Whether (x, y) is left of the edge from i to j; the opposite for that from j to i."""
    a, b = (i, j) if i < j else (j, i)
    along_x, along_y = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    area = along_x * (y - points[a, 1]) - along_y * (x - points[a, 0])
    return (area >= 0.0) == (i < j)


@numba.njit(cache=True, nogil=True)
def _cross(  # type: ignore[no-untyped-def]
    points, faces, lines, fill, place, step, write
):
    """Count the crossings of every line in `fill`, or write them to where `fill` says."""
    rows, columns, requested, (every_row, every_column) = lines
    for face in range(len(faces)):
        i, j, k = faces[face]
        p, q, r = points[i], points[j], points[k]
        highest_x, highest_y = max(p[0], q[0], r[0]), max(p[1], q[1], r[1])
        first_x = np.searchsorted(rows, min(p[0], q[0], r[0]))
        last_x = np.searchsorted(rows, highest_x, side="right")
        first_y = np.searchsorted(columns, min(p[1], q[1], r[1]))
        last_y = np.searchsorted(columns, highest_y, side="right")
        if first_x == last_x or first_y == last_y:
            continue
        for some_rows in range(first_x // every_row, (last_x - 1) // every_row + 1):
            low_x, high_x = some_rows * every_row, (some_rows + 1) * every_row
            for some in range(first_y // every_column, (last_y - 1) // every_column + 1):
                if not requested[some_rows, some]:
                    continue
                low_y, high_y = some * every_column, (some + 1) * every_column
                for row in range(max(first_x, low_x), min(last_x, high_x)):
                    x = rows[row]
                    for column in range(max(first_y, low_y), min(last_y, high_y)):
                        y = columns[column]
                        left = _left(points, i, j, x, y)
                        if _left(points, j, k, x, y) != left or _left(points, k, i, x, y) != left:
                            continue
                        line = row * len(columns) + column
                        if write:
                            place[fill[line]] = _height(p, q, r, x, y)
                            step[fill[line]] = -1 if left else 1
                        fill[line] += 1


@numba.njit(cache=True, nogil=True)
def _height(p, q, r, x, y):  # type: ignore[no-untyped-def]
    low, high = min(p[2], q[2], r[2]), max(p[2], q[2], r[2])
    a0, a1, b0, b1 = q[0] - p[0], q[1] - p[1], r[0] - p[0], r[1] - p[1]
    area = a0 * b1 - a1 * b0
    if area == 0.0:
        return 0.5 * (low + high)
    u = ((x - p[0]) * b1 - (y - p[1]) * b0) / area
    v = (a0 * (y - p[1]) - a1 * (x - p[0])) / area
    return min(max(p[2] + u * (q[2] - p[2]) + v * (r[2] - p[2]), low), high)


@numba.njit(cache=True, nogil=True)
def _sort(start, place, step):  # type: ignore[no-untyped-def]
    for line in range(len(start) - 1):
        for number in range(start[line] + 1, start[line + 1]):
            value, change = place[number], step[number]
            other = number - 1
            while other >= start[line] and place[other] > value:
                place[other + 1], step[other + 1] = place[other], step[other]
                other -= 1
            place[other + 1], step[other + 1] = value, change
