"""Which of the sample points of a grid's voxels are inside a surface.

The crossings of the lines through the points tell it, which takes a hundredth of what winding
numbers do. These are asked about points on lines that leave the solid by a hole, or on the surface,
and wherever the lines along the three axes do not agree.
"""

import numba
import numpy as np

from carillon.arrays import Flags, Index, Surface
from carillon.fem.geometry.crossings import line_crossings
from carillon.fem.geometry.grid import Grid
from carillon.fem.geometry.winding import Winding

NEAR = 1e-5
"""Distance [voxels] from a crossing up to which a point counts as on the surface."""
MOST_OPEN = 0.05
"""Share of the triangles' sides that may be open; lines find holes everywhere beyond that."""


class SamplePoints:
    """Points at equal distances in the voxels of a grid, `count`^3 of each.

    Parameters
    ----------
    count
        Odd, so that one is the voxel's centre.
    """

    def __init__(self, surface: Surface, grid: Grid, count: int) -> None:
        self._shape, self._count = grid.shape, count
        self._winding = Winding(surface, grid)
        self._lines = _lines(surface, grid, count)

    def centres(self) -> Flags:
        """Whether the centre of each voxel (nx, ny, nz) is inside."""
        index = np.indices(self._shape).reshape(3, -1).T
        return self.inside(self._count * index + self._count // 2).reshape(self._shape)

    def of_voxels(self, voxels: Index) -> Index:
        """Indices (v * count^3, 3) of the points in voxels (v, 3)."""
        offsets = np.indices((self._count,) * 3).reshape(3, -1).T
        return (self._count * voxels[:, None, :] + offsets).reshape(-1, 3)

    def inside(self, index: Index) -> Flags:
        """Whether the points with indices (p, 3) among those of the whole grid are inside."""
        if self._lines is None:
            return self._winding.inside((index + 0.5) / self._count)
        inside = np.zeros(len(index), dtype=np.bool_)
        unsure = np.zeros(len(index), dtype=np.bool_)
        for axis, (start, place, step) in enumerate(self._lines):
            columns = self._shape[(axis + 2) % 3] * self._count
            turned = np.ascontiguousarray(index[:, [(axis + 1) % 3, (axis + 2) % 3, axis]])
            _between(turned, columns, self._count, start, place, step, axis, inside, unsure)
        asked = np.flatnonzero(unsure)
        if len(asked):
            inside[asked] = self._winding.inside((index[asked] + 0.5) / self._count)
        return inside


def _lines(surface: Surface, grid: Grid, count: int) -> list | None:
    """Crossings of the lines through the points along each axis.

    None for triangles turned either way, whose crossings do not tell in from out, and for sieves.
    """
    import trimesh

    merged = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    merged.merge_vertices()
    edges = merged.edges_unique_inverse
    open_edges = np.count_nonzero(np.bincount(edges) == 1)
    if not merged.is_winding_consistent or open_edges > MOST_OPEN * len(edges):
        return None
    vertices = (merged.vertices - grid.origin) / grid.edge
    faces = np.ascontiguousarray(merged.faces, dtype=np.int64)
    places = [(np.arange(count * size) + 0.5) / count for size in grid.shape]
    return [
        line_crossings(vertices, faces, places[(axis + 1) % 3], places[(axis + 2) % 3], axis)
        for axis in range(3)
    ]


@numba.njit(cache=True, nogil=True)
def _between(  # type: ignore[no-untyped-def]
    index, columns, count, start, place, step, axis, inside, unsure
):
    """Tell what is inside by the lines along an axis, and what they disagree on with those before.

    The index (p, 3) of a point is that of its line's row and column, and along the line.
    """
    for point in range(len(index)):
        line = index[point, 0] * columns + index[point, 1]
        along = (index[point, 2] + 0.5) / count
        winding, total = 0, 0
        for number in range(start[line], start[line + 1]):
            total += step[number]
            if place[number] < along:
                winding += step[number]
            if abs(place[number] - along) < NEAR:
                unsure[point] = True
        if total != 0 or (axis > 0 and inside[point] != (winding != 0)):
            unsure[point] = True
        inside[point] = winding != 0
