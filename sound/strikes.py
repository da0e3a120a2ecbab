"""Struck points of a surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from carillon.errors import UserError
from sound.surface import longest_side

if TYPE_CHECKING:  # Its import takes long, and most of the room needs no surface.
    import trimesh

Array = NDArray[np.float64]

OFF_SURFACE = 0.02
"""Distance from the surface, over the surface's longest side, up to which a point is on it."""
OFF_VERTEX = 0.05
"""Distance from the nearest vertex, over the longest side, up to which that vertex is meant:
more than any point of `sound.surface.struck_surface` is from one."""
SAME_PLACE = 1e-6
"""Distance, over the longest side, within which two vertices are at one place."""
PROBE = 1e-3
"""Step from a vertex, over the longest side, that tells inside from outside."""
CLEAR = 0.25
"""Difference of winding numbers that tells inside from outside beyond their error."""


@dataclass(frozen=True)
class Strike:
    """A named point of the surface that is struck.

    Attributes
    ----------
    name : str
        Of the target whose clip is to sound there.
    vertex : int
        Number of the surface's vertex.
    position : (3,) [m]
        Of that vertex.
    inward : (3,)
        Unit vector into the solid.
    """

    name: str
    vertex: int
    position: Array
    inward: Array


@dataclass(frozen=True)
class Place:
    """Where a target is struck: `at` a position (3,) [m] or at a `vertex`, one of the two."""

    name: str
    at: Sequence[float] | None = None
    vertex: int | None = None


def locate(
    surface: trimesh.Trimesh,
    name: str,
    at: Sequence[float] | None = None,
    vertex: int | None = None,
) -> Strike:
    """The vertex of the surface that is struck, and the direction into the solid there.

    Parameters
    ----------
    surface
        Triangles in metres; vertices may be repeated, and triangles may face either way.
    name : str
        Of the target, for messages.
    at : (3,) [m] or None
        Position, whose nearest vertex is struck.
    vertex : int or None
        Number of the vertex; give this or `at`.

    Raises
    ------
    UserError
        If the position is further than `OFF_SURFACE` from the surface or than `OFF_VERTEX` from
        its vertices, or there is no such vertex.
    """
    return locate_all(surface, [Place(name, at, vertex)])[0]


def locate_all(surface: trimesh.Trimesh, places: Sequence[Place]) -> list[Strike]:
    """`locate` for several targets.

    Raises
    ------
    UserError
        Also if two targets are at one place.
    """
    numbers = np.array([vertex_of(surface, place) for place in places], dtype=np.int64)
    positions = np.asarray(surface.vertices, dtype=float)[numbers]
    for one, other in combinations(range(len(places)), 2):
        if np.linalg.norm(positions[one] - positions[other]) <= SAME_PLACE * longest_side(surface):
            raise UserError(
                f"targets {places[one].name!r} and {places[other].name!r} are both at vertex "
                f"{numbers[one]}, ({_numbers(positions[one])}) m; move one of them or leave it out"
            )
    inward = inward_normals(surface, positions)
    return [
        Strike(place.name, int(number), position, normal)
        for place, number, position, normal in zip(places, numbers, positions, inward)
    ]


def inward_normals(surface: trimesh.Trimesh, positions: Array) -> Array:
    """Unit vectors (p, 3) into the solid at vertices that lie at `positions` (p, 3).

    Minus the mean normal of the triangles that meet there, weighted by their angles.
    """
    import igl
    from scipy.spatial import cKDTree

    oriented = _oriented(surface)
    positions = positions - surface.bounds.mean(axis=0)
    chosen = cKDTree(oriented.vertices).query(positions)[1]
    inward = -np.asarray(oriented.vertex_normals)[chosen]
    for index in np.flatnonzero(np.linalg.norm(inward, axis=1) < 0.5):  # a sheet without thickness
        inward[index] = -oriented.face_normals[oriented.vertex_faces[chosen[index], 0]]
    step = PROBE * longest_side(surface) * inward
    vertices = np.ascontiguousarray(oriented.vertices, dtype=float)
    faces = np.ascontiguousarray(oriented.faces, dtype=np.int64)
    ahead, behind = (
        np.abs(igl.fast_winding_number(vertices, faces, np.ascontiguousarray(points)))
        for points in (positions + step, positions - step)
    )
    return np.asarray(np.where((behind > ahead + CLEAR)[:, None], -inward, inward))


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


def vertex_of(surface: trimesh.Trimesh, place: Place) -> int:
    """Number of the vertex that is struck, see `locate`."""
    if (place.at is None) == (place.vertex is None):
        raise UserError(f"target {place.name!r}: expected either a position or a vertex")
    if place.vertex is None:
        assert place.at is not None
        return _nearest_vertex(surface, place.name, np.asarray(place.at, dtype=float))
    count = len(surface.vertices)
    if not 0 <= place.vertex < count:
        raise UserError(
            f"target {place.name!r}: there is no vertex {place.vertex}, the surface has {count:,} "
            f"of them, numbered from 0 to {count - 1}"
        )
    if place.vertex not in surface.faces:
        raise UserError(
            f"target {place.name!r}: vertex {place.vertex} belongs to no triangle; name one of the "
            "surface"
        )
    return place.vertex


def _nearest_vertex(surface: trimesh.Trimesh, name: str, at: Array) -> int:
    import igl

    if not np.isfinite(at).all():
        raise UserError(f"target {name!r}: the point ({_numbers(at)}) m is not finite")
    vertices = np.ascontiguousarray(surface.vertices, dtype=float)
    faces = np.ascontiguousarray(surface.faces, dtype=np.int64)
    used = np.unique(faces)
    away = np.linalg.norm(vertices[used] - at, axis=1)
    nearest, side = int(used[np.argmin(away)]), longest_side(surface)
    to_surface = float(np.sqrt(igl.point_mesh_squared_distance(at[None], vertices, faces)[0][0]))
    place = f"target {name!r}: the point ({_numbers(at)}) m is {{:.3g}} m from {{}}"
    hint = f"; the nearest vertex is {nearest} at ({_numbers(vertices[nearest])}) m"
    for distance, share, what in (
        (to_surface, OFF_SURFACE, "the surface"),
        (float(away.min()), OFF_VERTEX, "the surface's vertices"),
    ):
        if distance > share * side:
            raise UserError(
                f"{place.format(distance, what)}, expected at most {share:.0%} of its longest "
                f"side, {share * side:.3g} m{hint}"
            )
    return nearest


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


def _numbers(point: Array) -> str:
    return ", ".join(f"{x:.4g}" for x in point)
