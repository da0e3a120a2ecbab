"""Which cell of a volume mesh a point lies in.

A cell is the tetrahedra between its middle and the triangles of its faces. Points are mostly spread
evenly, as voxels are, so that cells are found by the cubes of a grid over which they reach.
"""

import numba
import numpy as np

from carillon.arrays import Array, Index

ENTRIES = 24
"""Cells that reach over a cube of the grid, in the mean over as many cubes as cells, at most."""
ROUNDING = 1e-9
"""Barycentric coordinate below zero up to which a point is in a tetrahedron: on its face."""


class CellSearch:
    """Cells in the cubes of a grid."""

    def __init__(self, points: Array, triangles: Index, start: Index) -> None:
        """Cells of points (p, 3); cell i has the `triangles` start[i] to start[i + 1]."""
        self._points = np.ascontiguousarray(points, dtype=float)
        self._triangles = np.ascontiguousarray(triangles)
        self._start = np.ascontiguousarray(start)
        count = len(start) - 1
        self._boxes = np.empty((count, 6))
        self._middles = np.empty((count, 3))
        _bound(self._points, self._triangles, self._start, self._boxes, self._middles)
        self._low = self._boxes[:, :3].min(axis=0)
        sides = self._boxes[:, 3:].max(axis=0) - self._low
        edge = float(np.maximum(sides, 1e-3 * sides.max()).prod() / count) ** (1.0 / 3.0)
        while True:
            shape = np.maximum(np.ceil(sides / edge), 1.0).astype(np.int64)
            counts = np.zeros(int(shape.prod()) + 1, dtype=np.int64)
            limit = ENTRIES * max(count, 1000)
            fits = _count(self._boxes, self._low, edge, shape, counts, limit)
            if fits or (shape == 1).all():
                break
            edge *= 2.0
        self._edge, self._shape = edge, shape
        self._begin = np.cumsum(counts)
        self._cells = np.empty(int(self._begin[-1]), dtype=np.int32)
        _fill(self._boxes, self._low, edge, shape, self._begin[:-1].copy(), self._cells)

    def cells_at(self, points: Array) -> Index:
        """Cell (q,) that each of `points` (q, 3) lies in, on a common face the first; else -1."""
        found = np.empty(len(points), dtype=np.int64)
        mesh = self._points, self._triangles, self._start, self._boxes, self._middles
        grid = self._low, self._edge, self._shape, self._begin, self._cells
        _find(np.ascontiguousarray(points, dtype=float), mesh, grid, found)
        return found


@numba.njit(cache=True, nogil=True)
def _bound(points, triangles, start, boxes, middles):  # type: ignore[no-untyped-def]
    """Boxes around cells, and the means of their triangles' corners."""
    for cell in range(len(start) - 1):
        for axis in range(3):
            low, high, total = np.inf, -np.inf, 0.0
            for triangle in range(start[cell], start[cell + 1]):
                for corner in range(3):
                    place = points[triangles[triangle, corner], axis]
                    low, high = min(low, place), max(high, place)
                    total += place
            boxes[cell, axis], boxes[cell, 3 + axis] = low, high
            middles[cell, axis] = total / (3 * (start[cell + 1] - start[cell]))


@numba.njit(cache=True, nogil=True)
def _reach(box, low, edge, shape, axis):  # type: ignore[no-untyped-def]
    """First cube and the one after the last that a box reaches over along an axis."""
    slack = 1e-9 * shape[axis]
    first = int(np.floor((box[axis] - low[axis]) / edge - slack))
    last = int(np.floor((box[3 + axis] - low[axis]) / edge + slack))
    top = shape[axis] - 1
    return min(max(first, 0), top), min(max(last, 0), top) + 1


@numba.njit(cache=True, nogil=True)
def _count(boxes, low, edge, shape, counts, limit):  # type: ignore[no-untyped-def]
    """Count the cells of each cube in counts[1:], unless they are more than a limit."""
    total = 0
    for cell in range(len(boxes)):
        x0, x1 = _reach(boxes[cell], low, edge, shape, 0)
        y0, y1 = _reach(boxes[cell], low, edge, shape, 1)
        z0, z1 = _reach(boxes[cell], low, edge, shape, 2)
        total += (x1 - x0) * (y1 - y0) * (z1 - z0)
        if total > limit and shape[0] * shape[1] * shape[2] > 1:
            return False
        for z in range(z0, z1):
            for y in range(y0, y1):
                for x in range(x0, x1):
                    counts[1 + x + shape[0] * (y + shape[1] * z)] += 1
    return True


@numba.njit(cache=True, nogil=True)
def _fill(boxes, low, edge, shape, fill, cells):  # type: ignore[no-untyped-def]
    for cell in range(len(boxes)):
        x0, x1 = _reach(boxes[cell], low, edge, shape, 0)
        y0, y1 = _reach(boxes[cell], low, edge, shape, 1)
        z0, z1 = _reach(boxes[cell], low, edge, shape, 2)
        for z in range(z0, z1):
            for y in range(y0, y1):
                for x in range(x0, x1):
                    cube = x + shape[0] * (y + shape[1] * z)
                    cells[fill[cube]] = cell
                    fill[cube] += 1


@numba.njit(cache=True, nogil=True)
def _find(queries, mesh, grid, found):  # type: ignore[no-untyped-def]
    points, triangles, start, boxes, middles = mesh
    low, edge, shape, begin, cells = grid
    for query in range(len(queries)):
        point = queries[query]
        cube, inside = 0, True
        stride = 1
        for axis in range(3):
            place = (point[axis] - low[axis]) / edge
            inside = inside and -1e-6 * shape[axis] <= place <= (1.0 + 1e-6) * shape[axis]
            number = min(max(int(np.floor(place)), 0), shape[axis] - 1) if inside else 0
            cube += stride * number
            stride *= shape[axis]
        found[query] = -1
        if not inside:
            continue
        for entry in range(begin[cube], begin[cube + 1]):
            cell = cells[entry]
            if _is_in_cell(point, cell, points, triangles, start, boxes, middles):
                found[query] = cell
                break


@numba.njit(cache=True, nogil=True)
def _is_in_cell(  # type: ignore[no-untyped-def]
    point, cell, points, triangles, start, boxes, middles
):
    box = boxes[cell]
    for axis in range(3):
        slack = ROUNDING * (box[3 + axis] - box[axis]) + 1e-14 * abs(point[axis])
        if point[axis] < box[axis] - slack or point[axis] > box[3 + axis] + slack:
            return False
    top = middles[cell]
    d0, d1, d2 = point[0] - top[0], point[1] - top[1], point[2] - top[2]
    for triangle in range(start[cell], start[cell + 1]):
        a = points[triangles[triangle, 0]]
        b = points[triangles[triangle, 1]]
        c = points[triangles[triangle, 2]]
        a0, a1, a2 = a[0] - top[0], a[1] - top[1], a[2] - top[2]
        b0, b1, b2 = b[0] - top[0], b[1] - top[1], b[2] - top[2]
        c0, c1, c2 = c[0] - top[0], c[1] - top[1], c[2] - top[2]
        n0, n1, n2 = b1 * c2 - b2 * c1, b2 * c0 - b0 * c2, b0 * c1 - b1 * c0
        volume = a0 * n0 + a1 * n1 + a2 * n2
        if volume == 0.0:
            continue
        u = (d0 * n0 + d1 * n1 + d2 * n2) / volume
        m0, m1, m2 = d1 * c2 - d2 * c1, d2 * c0 - d0 * c2, d0 * c1 - d1 * c0
        v = (a0 * m0 + a1 * m1 + a2 * m2) / volume
        m0, m1, m2 = b1 * d2 - b2 * d1, b2 * d0 - b0 * d2, b0 * d1 - b1 * d0
        w = (a0 * m0 + a1 * m1 + a2 * m2) / volume
        if min(min(u, v), min(w, 1.0 - u - v - w)) >= -ROUNDING:
            return True
    return False
