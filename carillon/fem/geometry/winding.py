"""Winding numbers about points, which tell inside from outside also where surfaces have holes.

Jacobson et al. 2013; by the hierarchy of Barill et al. 2018.
"""

import numpy as np

from carillon.arrays import Surface
from carillon.fem.geometry.grid import Grid

#: Winding number from which a point is inside. Below the 1/2 of a point on the surface by more than
#: the error of fast winding numbers (0.02), so that a wall through sample points is not ragged.
INSIDE = 0.45

#: Edges [voxels] that the surface is cut to: the hierarchy suffers from long triangles.
LONGEST = 2.0

#: Points whose winding number is computed at once.
CHUNK = 2_000_000


class Winding:
    """Winding numbers of a surface about points, in voxels from the corner of a grid."""

    def __init__(self, surface: Surface, grid: Grid) -> None:
        self._surface, self._grid = surface, grid
        self._triangles: tuple[np.ndarray, np.ndarray] | None = None

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Winding numbers (p,) about points (p, 3)."""
        import igl

        if self._triangles is None:
            self._triangles = self._cut()
        numbers = np.empty(len(points))
        for start in range(0, len(points), CHUNK):
            part = slice(start, start + CHUNK)
            chunk = np.ascontiguousarray(points[part])
            numbers[part] = igl.fast_winding_number(*self._triangles, chunk)
        return numbers

    def inside(self, points: np.ndarray) -> np.ndarray:
        """Whether points (p, 3) are inside."""
        return np.asarray(np.abs(self(points)) > INSIDE)

    def _cut(self) -> tuple[np.ndarray, np.ndarray]:
        """Vertices in voxel units, so that nothing depends on the unit of length, and triangles."""
        import trimesh

        vertices, faces = trimesh.remesh.subdivide_to_size(
            self._surface.vertices,
            self._surface.faces,
            max_edge=LONGEST * self._grid.edge,
            max_iter=30,
        )
        vertices = np.ascontiguousarray((vertices - self._grid.origin) / self._grid.edge)
        return vertices, np.ascontiguousarray(faces, dtype=np.int64)
