"""Which voxels of a grid a surface touches."""

import numba
import numpy as np

from carillon.arrays import Flags, Surface
from carillon.fem.geometry.grid import Grid

LONGEST = 0.5
"""Edges [voxels] to which triangles are cut so that no voxel is missed that matters."""
FIRST = 2.0
"""Edges [voxels] to which they are cut before that, long ones across."""
_ROOM = 256
"""Triangles that wait to be cut, to begin with."""


def touched_voxels(surface: Surface, grid: Grid) -> Flags:
    """Voxels (nx, ny, nz) that hold a vertex once all edges are cut in halves up to `LONGEST`.

    What is beside the grid counts as in its outermost voxels.
    """
    touched = np.zeros(grid.shape, dtype=np.bool_)
    vertices, faces = np.asarray(surface.vertices), np.asarray(surface.faces, dtype=np.int64)
    lengths = np.array([FIRST, LONGEST]) * grid.edge
    _touch(np.ascontiguousarray(vertices), faces, lengths, grid.origin, grid.edge, touched)
    return touched


@numba.njit(cache=True, nogil=True)
def _touch(vertices, faces, longest, origin, edge, touched):  # type: ignore[no-untyped-def]
    waiting = np.empty((_ROOM, 3, 3))
    long, length = np.empty(3, dtype=np.bool_), np.empty(3)
    middle = np.empty((3, 3))
    for face in range(len(faces)):
        for corner in range(3):
            waiting[0, corner] = vertices[faces[face, corner]]
        count = 1
        while count:
            count -= 1
            corners = waiting[count].copy()
            for side in range(3):
                a, b = corners[side], corners[(side + 1) % 3]
                for axis in range(3):
                    middle[side, axis] = 0.5 * (a[axis] + b[axis])
                length[side] = np.sqrt(_square(b, a))
            allowed = longest[0] if length.max() > longest[0] else longest[1]
            cuts = 0
            for side in range(3):
                long[side] = length[side] > allowed
                cuts += long[side]
            if cuts == 0:
                for corner in range(3):
                    _mark(corners[corner], origin, edge, touched)
                continue
            if count + 4 > len(waiting):
                more = np.empty((2 * len(waiting), 3, 3))
                more[:count] = waiting[:count]
                waiting = more
            count = _cut(corners, middle, long, cuts, waiting, count)


@numba.njit(cache=True, nogil=True)
def _mark(point, origin, edge, touched):  # type: ignore[no-untyped-def]
    x = min(max(int(np.floor((point[0] - origin[0]) / edge)), 0), touched.shape[0] - 1)
    y = min(max(int(np.floor((point[1] - origin[1]) / edge)), 0), touched.shape[1] - 1)
    z = min(max(int(np.floor((point[2] - origin[2]) / edge)), 0), touched.shape[2] - 1)
    touched[x, y, z] = True


@numba.njit(cache=True, nogil=True)
def _cut(corners, middle, long, cuts, waiting, count):  # type: ignore[no-untyped-def]
    """Push the two, three or four parts of a triangle whose long sides are cut."""
    if cuts == 3:
        for corner in range(3):
            _push(waiting, count, corners[corner], middle[corner], middle[(corner + 2) % 3])
            count += 1
        _push(waiting, count, middle[0], middle[1], middle[2])
        return count + 1
    # The first side that is cut, after one that is not.
    first = 0
    while not (long[first] and not long[(first + 2) % 3]):
        first += 1
    a, b, c = corners[first], corners[(first + 1) % 3], corners[(first + 2) % 3]
    p, q = middle[first], middle[(first + 1) % 3]
    if cuts == 1:
        _push(waiting, count, a, p, c)
        _push(waiting, count + 1, p, b, c)
        return count + 2
    _push(waiting, count, p, b, q)
    if _square(a, q) <= _square(p, c):
        _push(waiting, count + 1, a, p, q)
        _push(waiting, count + 2, a, q, c)
    else:
        _push(waiting, count + 1, a, p, c)
        _push(waiting, count + 2, p, q, c)
    return count + 3


@numba.njit(cache=True, nogil=True)
def _push(waiting, place, a, b, c):  # type: ignore[no-untyped-def]
    for axis in range(3):
        waiting[place, 0, axis] = a[axis]
        waiting[place, 1, axis] = b[axis]
        waiting[place, 2, axis] = c[axis]


@numba.njit(cache=True, nogil=True)
def _square(a, b):  # type: ignore[no-untyped-def]
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2
