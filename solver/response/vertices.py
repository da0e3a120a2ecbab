"""Struck vertices of a triangulated surface: directions into the solid there, and distant ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from carillon.arrays import Array, Flags

if TYPE_CHECKING:  # Its import takes long, and most of the room needs no surface.
    import trimesh

PROBE = 1e-3
"""Step from a vertex that tells inside from outside, over the surface's longest side."""
CLEAR = 0.25
"""Difference of winding numbers that tells inside from outside beyond their error."""


def inward_normals(surface: trimesh.Trimesh, positions: Array) -> Array:
    """Unit vectors (p, 3) into the solid at vertices that lie at `positions` (p, 3).

    Minus the mean normal of the triangles that meet there, weighted by their angles. Triangles of
    closed parts are turned outwards by the sign of their volume, others by winding numbers.
    """
    import igl
    from scipy.spatial import cKDTree

    oriented = _oriented(surface)
    positions = positions - surface.bounds.mean(axis=0)
    chosen = cKDTree(oriented.vertices).query(positions)[1]
    inward = -np.asarray(oriented.vertex_normals)[chosen]
    for index in np.flatnonzero(np.linalg.norm(inward, axis=1) < 0.5):  # a sheet without thickness
        inward[index] = -oriented.face_normals[oriented.vertex_faces[chosen[index], 0]]
    doubtful = np.flatnonzero(~_in_closed_part(oriented)[chosen])
    if not len(doubtful):
        return np.asarray(inward)
    step = PROBE * float(np.max(surface.extents)) * inward[doubtful]
    vertices = np.ascontiguousarray(oriented.vertices, dtype=float)
    faces = np.ascontiguousarray(oriented.faces, dtype=np.int64)
    ahead, behind = (
        np.abs(igl.fast_winding_number(vertices, faces, np.ascontiguousarray(points)))
        for points in (positions[doubtful] + step, positions[doubtful] - step)
    )
    inward[doubtful[behind > ahead + CLEAR]] *= -1.0
    return np.asarray(inward)


def spread(candidates: Array, taken: Array, count: int) -> list[int]:
    """Numbers of points, each one the farthest from all before.

    Parameters
    ----------
    candidates : (c, 3) [m]
        Points to choose from.
    taken : (t, 3) [m]
        Points to keep away from, too.
    count : int
        How many to choose; fewer are if there are not so many places.
    """
    away = np.min([np.linalg.norm(candidates - point, axis=1) for point in taken], axis=0)
    chosen: list[int] = []
    while len(chosen) < count and away.any():
        chosen.append(int(np.argmax(away)))
        away = np.minimum(away, np.linalg.norm(candidates - candidates[chosen[-1]], axis=1))
    return chosen


def _oriented(surface: trimesh.Trimesh) -> trimesh.Trimesh:
    """The surface around the origin, vertices at one place merged, triangles turned outwards."""
    import trimesh

    # The sign of the volume of a part with holes depends on the origin least if that is in it.
    vertices = np.asarray(surface.vertices) - surface.bounds.mean(axis=0)
    merged = trimesh.Trimesh(vertices, surface.faces, process=False)
    merged.merge_vertices()
    merged.update_faces(merged.nondegenerate_faces())
    merged.remove_unreferenced_vertices()
    trimesh.repair.fix_normals(merged, multibody=True)
    return merged


def _in_closed_part(oriented: trimesh.Trimesh) -> Flags:
    """Whether all triangles at each vertex (v,) belong to closed parts that face outwards."""
    from carillon.fem.geometry.facets import Facets, parts_of, signed_volumes

    faces = np.asarray(oriented.faces)
    facets = Facets.of_surface(np.asarray(oriented.vertices), faces)
    closed = np.zeros(len(faces), dtype=bool)
    if len(facets):
        ones = np.ones(len(facets), dtype=np.int64)
        part, is_closed = parts_of(facets, ones, facets.unbalanced(ones))
        is_closed &= signed_volumes(facets, part, ones) > 0.0
        there = facets.of_face >= 0
        closed[there] = is_closed[part[facets.of_face[there]]]
        closed &= np.bincount(facets.of_face[there], minlength=len(facets))[facets.of_face] == 1
    beside = np.bincount(faces[~closed].ravel(), minlength=len(oriented.vertices))
    return np.asarray(beside == 0)
