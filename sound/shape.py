"""Surfaces of bodies: vertices about the centre of mass, normals and radii of curvature."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Integers

SHARPEST = 5e-4
"""Least radius of curvature [m]: edges of things are rounded by use."""
SMOOTHINGS = 2
"""Number of times that the curvature at each vertex is averaged with its neighbours'."""


@dataclass(frozen=True)
class Shape:
    """A surface of vertices (V, 3) [m] and triangles (F, 3) in an object's own axes, from its
    centre of mass.

    At the vertices, `inward` (V, 3) are unit vectors into the solid, and `radii` (V,) [m] those of
    curvature.
    """

    vertices: Array
    faces: Integers
    inward: Array
    radii: Array

    @classmethod
    def of_surface(
        cls, vertices: Array, faces: Integers, centre: Array, radius: float | None = None
    ) -> Shape:
        """The shape of a surface about a centre (3,) [m]; `radius` [m] is that of a ball."""
        import trimesh

        from solver.response.vertices import inward_normals

        surface = trimesh.Trimesh(vertices, faces, process=False)
        inward = inward_normals(surface, vertices)
        if radius is not None:
            radii = np.full(len(vertices), radius)
        else:
            radii = vertex_radii(vertices, faces, inward)
        return cls(vertices - centre, faces, inward, radii)


def vertex_radii(vertices: Array, faces: Integers, normals: Array) -> Array:
    """Radii of curvature (V,) [m], from the angles between the normals of neighbouring vertices.

    They lie between `SHARPEST` and half of the longest side, which stands for flat.
    """
    edges = np.unique(np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1), axis=0)
    first, second = edges.T
    long = np.maximum(np.linalg.norm(vertices[first] - vertices[second], axis=1), 1e-12)
    turned = np.linalg.norm(normals[first] - normals[second], axis=1)
    curvature = _mean_at(first, second, turned / long, turned / long, len(vertices))
    for _ in range(SMOOTHINGS):
        near = _mean_at(first, second, curvature[second], curvature[first], len(vertices))
        curvature = 0.5 * (curvature + near)
    widest = 0.5 * float(np.ptp(vertices, axis=0).max())
    return np.clip(1.0 / np.maximum(curvature, 1e-12), min(SHARPEST, widest), widest)


def _mean_at(
    first: NDArray[np.integer],
    second: NDArray[np.integer],
    to_first: Array,
    to_second: Array,
    n: int,
) -> Array:
    """Mean (n,) at each vertex of the values that its edges have for their first or second end."""
    ends = np.concatenate([first, second])
    sums = np.bincount(ends, np.concatenate([to_first, to_second]), n)
    return np.asarray(sums / np.maximum(np.bincount(ends, minlength=n), 1))
