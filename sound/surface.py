"""Struck and visible surface: that of the mesh file, refined to have a vertex near every point."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array

if TYPE_CHECKING:  # Its import takes long, and most of the room needs no surface.
    import trimesh

Faces = NDArray[np.int64]

LONGEST_EDGE = 1.0 / 16.0
"""Greatest length of an edge, over the surface's longest side; longer edges are halved."""


def struck_surface(mesh: str, unit: float = 1.0) -> trimesh.Trimesh:
    """Surface of a mesh in metres, without edges above `LONGEST_EDGE` of its longest side.

    The mesh's own vertices come first and keep their numbers.

    Parameters
    ----------
    mesh, unit
        See `carillon.fem.geometry.load_surface`.

    Raises
    ------
    UserError
        If there is no such mesh.
    """
    import trimesh

    from carillon.fem.geometry import load_surface

    surface = load_surface(mesh, unit)
    longest = LONGEST_EDGE * longest_side(surface)
    vertices, faces = np.asarray(surface.vertices), np.asarray(surface.faces)
    return trimesh.Trimesh(*_cut(vertices, faces, longest), process=False)


def longest_side(surface: trimesh.Trimesh) -> float:
    """Longest side [m] of the bounding box."""
    return float(np.max(surface.extents))


def _cut(vertices: Array, faces: Faces, longest: float) -> tuple[Array, Faces]:
    """Halve edges longer than `longest` in all triangles that share them, until there are none."""
    while True:
        ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2)
        sides = np.sort(ends.reshape(-1, 2), axis=1)
        edges, of_sides = np.unique(sides, axis=0, return_inverse=True)
        first, second = vertices[edges[:, 0]], vertices[edges[:, 1]]
        long = np.linalg.norm(second - first, axis=1) > longest
        if not long.any():
            return vertices, faces
        middles = np.full(len(edges), -1)
        middles[long] = len(vertices) + np.arange(np.count_nonzero(long))
        vertices = np.concatenate([vertices, (first + second)[long] / 2.0])
        faces = _with_middles(faces, middles[of_sides].reshape(-1, 3))


def _with_middles(faces: Faces, middles: Faces) -> Faces:
    """Triangles (t, 3) cut at the middles (t, 3) of their sides 01, 12 and 20, -1 where uncut."""
    parts = [faces[(middles < 0).all(axis=1)]]
    for turn in range(3):
        (a, b, c), (ab, bc, ca) = (np.roll(x, -turn, axis=1).T for x in (faces, middles))
        one = (ab >= 0) & (bc < 0) & (ca < 0)
        two = (ab >= 0) & (bc >= 0) & (ca < 0)
        three = (ab >= 0) & (bc >= 0) & (ca >= 0)
        parts += [np.stack(part, axis=1)[one] for part in ((a, ab, c), (ab, b, c))]
        parts += [np.stack(part, axis=1)[two] for part in ((ab, b, bc), (a, ab, bc), (a, bc, c))]
        parts.append(np.stack((a, ab, ca), axis=1)[three])
        if turn == 0:
            parts.append(np.stack((ab, bc, ca), axis=1)[three])
    return np.concatenate(parts)
