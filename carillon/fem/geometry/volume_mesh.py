"""Meshes of volume elements: their outer surface, and which element a point lies in."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index
from carillon.errors import UserError
from carillon.fem.geometry.cell_search import CellSearch
from carillon.fem.geometry.cell_shapes import faces_of
from carillon.fem.geometry.facets import DIGITS
from carillon.fem.geometry.located import LocatedCells

if TYPE_CHECKING:
    import trimesh

Block = tuple[str, Index]
"""Kind of elements, by meshio's names, and their nodes (c, k)."""


@dataclass(frozen=True, eq=False)
class VolumeMesh(LocatedCells):
    """Elements, what is known of each, and the names of their parts.

    Elements are the tetrahedra between their middle and the triangles of their faces. Neighbours
    have these in common, so that the elements leave no gap, whether faces are plane or not.
    """

    name: str
    """For messages."""
    points: Array
    """(p, 3) [m]."""
    blocks: list[Block]
    """Elements by kind; they are numbered through."""
    data: dict[str, NDArray[Any]] = field(default_factory=dict)
    """(c,) of each array of the elements."""
    names: dict[int, str] = field(default_factory=dict)
    """Names of parts by the labels that elements have."""

    @property
    def n_cells(self) -> int:
        """Number of elements."""
        return sum(len(cells) for _, cells in self.blocks)

    @cached_property
    def _triangles(self) -> _Triangles:
        return _triangles_of(self)

    @cached_property
    def surface(self) -> trimesh.Trimesh:
        """The outer faces, turned outwards, curved ones as the triangles between their nodes.

        Raises UserError if there are none.
        """
        import trimesh

        parts = self._triangles
        triangles = parts.triangles[parts.is_outer]
        if not len(triangles):
            raise UserError(f"{self.name}: its elements have no outer faces, expected a solid")
        used, corners = np.unique(triangles, return_inverse=True)
        vertices = parts.points[used]
        faces = corners.reshape(-1, 3)
        inwards = (_volumes(parts) < 0.0)[parts.cell[parts.is_outer]]
        faces[inwards] = faces[inwards, ::-1]
        return trimesh.Trimesh(vertices, faces, process=False)

    @cached_property
    def _search(self) -> CellSearch:
        parts = self._triangles
        order = np.argsort(parts.cell, kind="stable")
        start = np.searchsorted(parts.cell[order], np.arange(self.n_cells + 1))
        return CellSearch(parts.points, parts.triangles[order], start)

    @property
    def longest_side(self) -> float:
        return float(self.surface.extents.max())

    def cells_at(self, points: Array, nearest: bool = False) -> Index:
        points = np.ascontiguousarray(points, dtype=float)
        cells = self._search.cells_at(points)
        outside = np.flatnonzero(cells < 0)
        if nearest and len(outside):
            import igl

            parts = self._triangles
            own = np.ascontiguousarray(parts.triangles[parts.is_outer])
            found = igl.point_mesh_squared_distance(points[outside], parts.points, own)[1]
            cells[outside] = parts.cell[parts.is_outer][np.atleast_1d(found)]
        return cells


@dataclass(frozen=True, eq=False)
class _Triangles:
    points: Array
    """(p, 3) of the mesh and in the middle of curved faces."""
    triangles: Index
    """(t, 3)."""
    cell: Index
    """(t,) element that each is of."""
    is_outer: Flags
    """(t,) whether the element has no neighbour there."""


def _triangles_of(mesh: VolumeMesh) -> _Triangles:
    place = _places(mesh.points)
    points, triangles, cells, faces, corners = [mesh.points], [], [], [], []
    first = count = 0
    added = len(mesh.points)
    for name, nodes in mesh.blocks:
        for face in faces_of(name, nodes, mesh.points, added):
            points.append(face.added)
            added += len(face.added)
            size, many = face.triangles.shape[:2]
            triangles.append(face.triangles.reshape(-1, 3).astype(np.int64))
            cells.append(np.repeat(np.arange(first, first + size), many))
            faces.append(np.repeat(np.arange(count, count + size), many))
            key = np.full((size, 4), -1)
            key[:, : face.corners.shape[1]] = place[face.corners]
            corners.append(np.sort(key, axis=1))
            count += size
        first += len(nodes)
    alone = _once(np.concatenate(corners))
    return _Triangles(
        np.concatenate(points),
        np.concatenate(triangles),
        np.concatenate(cells),
        alone[np.concatenate(faces)],
    )


def _places(points: Array) -> Index:
    """Number (p,) of the place of each point: where parts meet, each may have nodes of its own."""
    from trimesh.grouping import unique_rows

    low = points.min(axis=0)
    longest = float((points.max(axis=0) - low).max())
    scaled = (points - low) / (longest if longest > 0.0 else 1.0)
    return np.asarray(unique_rows(scaled, digits=DIGITS)[1])


def _once(rows: Index) -> Flags:
    """Which rows (f, 4) are there once."""
    order = np.lexsort(rows.T)
    new = np.ones(len(rows) + 1, dtype=bool)
    new[1:-1] = (rows[order[1:]] != rows[order[:-1]]).any(axis=1)
    once = np.empty(len(rows), dtype=bool)
    once[order] = new[:-1] & new[1:]
    return once


def _volumes(parts: _Triangles) -> Array:
    """Volumes (c,) of elements by the triangles of their faces, negative where these face in."""
    first = np.empty(parts.cell.max() + 1, dtype=np.int64)
    first[parts.cell] = parts.triangles[:, 0]
    arms = parts.points[parts.triangles] - parts.points[first[parts.cell]][:, None]
    cones = np.einsum("ti,ti->t", arms[:, 0], np.cross(arms[:, 1], arms[:, 2])) / 6.0
    return np.asarray(np.bincount(parts.cell, cones))
