"""Meshes for boundary elements: closed surfaces with triangles of even size."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from carillon.arrays import Array, Complex, Integers
from carillon.errors import UserError

LONGEST = 1.3
"""Length of an edge, over that of even triangles, above which it is halved before triangles are
merged."""


@dataclass(frozen=True)
class BoundaryMesh:
    """A closed surface of vertices (V, 3) [m] and triangles (F, 3), whose normals point outward."""

    vertices: Array
    faces: Integers

    @cached_property
    def normals_and_areas(self) -> tuple[Array, Array]:
        """Outward unit normals (F, 3) and areas (F,) [m^2] of the triangles."""
        corners = self.vertices[self.faces]
        doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(doubled, axis=1)
        return doubled / lengths[:, None], lengths / 2.0

    def hat_products(self) -> Array:
        """Integrals (V, V) [m^2] of the products of the vertices' hat functions."""
        _, areas = self.normals_and_areas
        total = np.zeros((len(self.vertices), len(self.vertices)))
        for first in range(3):
            for second in range(3):
                share = 6.0 if first == second else 12.0
                np.add.at(total, (self.faces[:, first], self.faces[:, second]), areas / share)
        return total

    @cached_property
    def middles(self) -> Array:
        """Middles (3 F, 3) [m] of the triangles' edges, triangle after triangle.

        The mean over them integrates what is quadratic on a triangle exactly.
        """
        corners = self.vertices[self.faces]
        return (0.5 * (corners + np.roll(corners, -1, axis=1))).reshape(-1, 3)

    def at_middles(self, values: Complex) -> Complex:
        """Values (..., 3 F) there of what is linear on triangles, from those at vertices."""
        following = np.roll(self.faces, -1, axis=1)
        found = 0.5 * (values[..., self.faces] + values[..., following])
        return np.asarray(found.reshape(*values.shape[:-1], -1))

    def flows(self, motion: Array) -> Array:
        """Integrals (V, N) [m^2] of the outward motion times the hat function of each vertex.

        The `motion` (3 F, 3, N) [1] is that at the `middles`.
        """
        normals, areas = self.normals_and_areas
        by_middle = motion.reshape(len(self.faces), 3, 3, -1)
        shared = np.einsum("fcin,fi->fcn", by_middle, normals) * (areas / 6.0)[:, None, None]
        total = np.zeros((len(self.vertices), motion.shape[2]))
        np.add.at(total, self.faces, shared)
        np.add.at(total, np.roll(self.faces, -1, axis=1), shared)
        return total


def boundary_mesh(vertices: Array, faces: Integers, triangles: int) -> BoundaryMesh:
    """The surface of vertices (V, 3) [m] and faces (F, 3) with about so many even triangles.

    Long edges are halved, then short ones merged.  Raises UserError if the surface is open, or
    encloses nothing.
    """
    import igl
    import trimesh

    surface = trimesh.Trimesh(vertices, faces)
    surface.update_faces(surface.nondegenerate_faces())
    if not surface.is_watertight:
        raise UserError("its surface is open")
    trimesh.repair.fix_normals(surface, multibody=True)
    even = np.sqrt(surface.area / triangles * 4.0 / np.sqrt(3.0))
    cut, kept = trimesh.remesh.subdivide_to_size(
        surface.vertices, surface.faces, LONGEST * even, max_iter=30
    )
    fine = trimesh.Trimesh(cut, kept)
    fine.merge_vertices()
    points, corners = np.asarray(fine.vertices), np.asarray(fine.faces)
    if len(corners) > triangles:
        points, corners = igl.decimate(
            np.ascontiguousarray(points), np.ascontiguousarray(corners), triangles
        )[:2]
    merged = trimesh.Trimesh(points, corners, process=False)
    if not merged.is_watertight or not merged.volume > 0.0:
        raise UserError("its surface cannot be divided into even triangles")
    return BoundaryMesh(np.asarray(merged.vertices), np.asarray(merged.faces, dtype=np.int64))
