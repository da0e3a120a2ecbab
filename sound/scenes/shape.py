"""The surface of an object of a scene, and how it curves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Faces = NDArray[np.integer]

SHARPEST = 5e-4
"""Radius of what is sharp [m]: edges of things are rounded by use."""
SMOOTHINGS = 2
"""Rings of neighbours that a curvature is averaged over."""


@dataclass(frozen=True)
class Shape:
    """A surface in an object's own axes, from its centre of mass.

    Attributes
    ----------
    vertices, faces : (V, 3) [m], (F, 3)
        Triangles.
    inward : (V, 3)
        Unit vectors into the solid.
    radii : (V,) [m]
        Of the sphere that is as round as the surface is there.
    """

    vertices: Array
    faces: Faces
    inward: Array
    radii: Array

    @classmethod
    def of_surface(cls, vertices: Array, faces: Faces, centre: Array) -> Shape:
        """The shape of a surface in the axes of its mesh, about a centre (3,) [m]."""
        import trimesh

        from sound.strikes import inward_normals

        surface = trimesh.Trimesh(vertices, faces, process=False)
        inward = inward_normals(surface, vertices)
        return cls(vertices - centre, faces, inward, vertex_radii(vertices, faces, inward))


def vertex_radii(vertices: Array, faces: Faces, normals: Array) -> Array:
    """Radii of curvature (V,) [m], by how much normals turn from vertex to vertex.

    Between `SHARPEST` and half of the longest side, of which what is flat has the latter.
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
    """Means (n,) at the ends of edges of what each edge gives to its first and second end."""
    ends = np.concatenate([first, second])
    sums = np.bincount(ends, np.concatenate([to_first, to_second]), n)
    return np.asarray(sums / np.maximum(np.bincount(ends, minlength=n), 1))
