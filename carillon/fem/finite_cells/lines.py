"""Where lines through a lattice cross a surface.

Lines run along each axis through Gauss points of the voxels' sides. Where a line enters and leaves
the solid is found exactly and nothing is sampled along it, so that integrals over the inside are
sharp.
"""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]

LINES = 8
"""Lines along each side of a voxel. Even, so that none lies in its plane of symmetry."""

LINE_PLACES: Array = 0.5 + 0.5 * np.polynomial.legendre.leggauss(LINES)[0]
"""(LINES,) places of the lines on a voxel's edge, from 0 to 1."""
LINE_SHARES: Array = 0.5 * np.polynomial.legendre.leggauss(LINES)[1]
"""(LINES,) their weights, of sum one."""
BOUNDS: Array = 0.5 * (LINE_PLACES[1:] + LINE_PLACES[:-1])
"""(LINES - 1,) bounds between the pieces of an edge that the lines stand for."""


@dataclass(frozen=True)
class Lines:
    """Numbered places on the lines along one axis.

    Attributes
    ----------
    axis
        That the lines run along; across it are b = axis + 1 and c = axis + 2, modulo 3.
    columns
        Lines along c: line (i, j) across b and c has the number ``i * columns + j``.
    start : (lines + 1,)
        Range of each line's entries.
    """

    axis: int
    columns: int
    start: Index


@dataclass(frozen=True)
class Crossings(Lines):
    """Crossings with the triangles of a surface.

    Attributes
    ----------
    place : (k,)
        Ascending on each line, in lattice units.
    step : (k,) int8
        Change of the winding number there: 1 where the line enters a closed surface, -1 where it
        leaves.
    """

    place: Array
    step: NDArray[np.int8]


def crossings(vertices: Array, faces: Index, shape: tuple[int, int, int], axis: int) -> Crossings:
    """Crossings of the lines along an axis through a lattice of voxels.

    Triangles that share an edge agree on which side of it a line passes, so that a line through an
    edge crosses one of the two.

    Parameters
    ----------
    vertices : (v, 3)
        In lattice units.
    faces : (f, 3)
        Triangles; two that meet have the same vertices there.
    shape
        Voxels along the axes, all of which hold the surface.
    """
    b, c = (axis + 1) % 3, (axis + 2) % 3
    rows, columns = LINES * shape[b], LINES * shape[c]
    points = np.ascontiguousarray(vertices[:, [b, c, axis]])
    counts = np.zeros(rows * columns + 1, dtype=np.int64)
    nothing = np.empty(0), np.empty(0, dtype=np.int8)
    _cross(points, faces, LINE_PLACES, rows, columns, counts[1:], *nothing, False)
    start = np.cumsum(counts)
    place, step = np.empty(start[-1]), np.empty(start[-1], dtype=np.int8)
    _cross(points, faces, LINE_PLACES, rows, columns, start[:-1].copy(), place, step, True)
    _sort(start, place, step)
    return Crossings(axis, columns, start, place, step)


def crossings_of_voxels(lines: Crossings, shape: tuple[int, int, int]) -> NDArray[np.int32]:
    """Number (nx, ny, nz) of crossings in each voxel."""
    axis = lines.axis
    line = np.repeat(np.arange(len(lines.start) - 1), np.diff(lines.start))
    row, column = np.divmod(line, lines.columns)
    place = np.clip(lines.place.astype(np.int64), 0, shape[axis] - 1)
    index = np.empty((3, len(line)), dtype=np.int64)
    index[axis], index[(axis + 1) % 3], index[(axis + 2) % 3] = place, row // LINES, column // LINES
    flat = np.ravel_multi_index(tuple(index), shape)
    return np.bincount(flat, minlength=int(np.prod(shape))).reshape(shape).astype(np.int32)


@numba.njit(cache=True, nogil=True)
def _first_line(places, at):  # type: ignore[no-untyped-def]
    """Number of the first line at or above a coordinate, 0 at least."""
    voxel = int(np.floor(at))
    number = 0
    while number < len(places) and places[number] < at - voxel:
        number += 1
    return max(voxel * len(places) + number, 0)


@numba.njit(cache=True, nogil=True)
def _left(points, i, j, x, y):  # type: ignore[no-untyped-def]
    """Whether (x, y) is left of the edge from i to j; the opposite for that from j to i."""
    a, b = (i, j) if i < j else (j, i)
    along_x, along_y = points[b, 0] - points[a, 0], points[b, 1] - points[a, 1]
    area = along_x * (y - points[a, 1]) - along_y * (x - points[a, 0])
    return (area >= 0.0) == (i < j)


@numba.njit(cache=True, nogil=True)
def _cross(  # type: ignore[no-untyped-def]
    points, faces, places, rows, columns, fill, place, step, write
):
    """Count the crossings of every line in `fill`, or write them to where `fill` says."""
    n = len(places)
    for face in range(len(faces)):
        i, j, k = faces[face]
        p, q, r = points[i], points[j], points[k]
        highest_x, highest_y = max(p[0], q[0], r[0]), max(p[1], q[1], r[1])
        first_y = _first_line(places, min(p[1], q[1], r[1]))
        for row in range(_first_line(places, min(p[0], q[0], r[0])), rows):
            x = row // n + places[row % n]
            if x > highest_x:
                break
            for column in range(first_y, columns):
                y = column // n + places[column % n]
                if y > highest_y:
                    break
                left = _left(points, i, j, x, y)
                if _left(points, j, k, x, y) != left or _left(points, k, i, x, y) != left:
                    continue
                line = row * columns + column
                if write:
                    place[fill[line]] = _height(p, q, r, x, y)
                    step[fill[line]] = -1 if left else 1
                fill[line] += 1


@numba.njit(cache=True, nogil=True)
def _height(p, q, r, x, y):  # type: ignore[no-untyped-def]
    """Height of a triangle over (x, y)."""
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
