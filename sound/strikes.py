"""Struck points of a surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from carillon.arrays import Array
from carillon.command_line.progress import say
from carillon.errors import UserError
from solver.response.vertices import inward_normals
from sound.surface import longest_side

if TYPE_CHECKING:  # Its import takes long, and most of the room needs no surface.
    import trimesh


OFF_SURFACE = 1e-3
"""Distance from the surface, over the surface's longest side, from which it is told that a point is
moved: coordinates are rounded."""
OFF_VERTEX = 0.05
"""Distance from the nearest vertex, over the longest side, from which that is told: more than any
point of `sound.surface.struck_surface` is from one."""
TOO_FAR = 0.5
"""Distance from the surface, over the longest side, beyond which a point is a mistake."""
OTHER_UNITS = (1e-3, 1e3, 1e-2, 1e2, 0.0254, 1.0 / 0.0254)
"""Factors between units that people mix up."""
NEAR_IN_OTHER_UNIT = 0.02
"""Distance from the surface, over the longest side, that shows a point to be in another unit."""
SAME_PLACE = 1e-6
"""Distance, over the longest side, within which two vertices are at one place."""


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
    distance : float [m]
        Between that vertex and the position that was named; 0 if none was.
    """

    name: str
    vertex: int
    position: Array
    inward: Array
    distance: float = 0.0


@dataclass(frozen=True)
class Place:
    """Where a target is struck: `at` a position (3,) [mesh unit], or at a `vertex`."""

    name: str
    at: Sequence[float] | None = None
    vertex: int | None = None


def locate_all(
    surface: trimesh.Trimesh, places: Sequence[Place], unit: float = 1.0
) -> list[Strike]:
    """The vertices that are struck for some targets, and the directions into the solid there.

    A line of progress tells how far a position is off the surface.

    Parameters
    ----------
    surface
        Triangles in metres; vertices may be repeated, and triangles may face either way.
    places
        Where the targets are struck.
    unit : float [m]
        Metres per unit of the mesh's own coordinates.

    Raises
    ------
    UserError
        With a sentence for each target whose position is further than `TOO_FAR` from the surface or
        whose vertex is not there, and for any two at one place.
    """
    vertices, side = np.asarray(surface.vertices, dtype=float), longest_side(surface)
    found: list[tuple[str, int, float]] = []
    faults: list[str] = []
    for place in places:
        try:
            found.append((place.name, *vertex_of(surface, place, unit)))
        except UserError as error:
            faults.append(str(error))
    for (one, first, _), (other, second, _) in combinations(found, 2):
        if np.linalg.norm(vertices[first] - vertices[second]) <= SAME_PLACE * side:
            at = _shown(vertices[first] / unit, unit)
            faults.append(
                f"targets {one!r} and {other!r} are both at vertex {first}, {at}; move one of "
                "them or leave it out"
            )
    if faults:
        raise UserError(*faults)
    positions = vertices[[number for _, number, _ in found]]
    inward = inward_normals(surface, positions)
    return [
        Strike(name, number, position, normal, distance)
        for (name, number, distance), position, normal in zip(found, positions, inward)
    ]


def vertex_of(surface: trimesh.Trimesh, place: Place, unit: float) -> tuple[int, float]:
    """Number of the vertex at a place, and its distance from the point named [m]."""
    if (place.at is None) == (place.vertex is None):
        raise UserError(f"target {place.name!r}: expected either a position or a vertex")
    if place.vertex is None:
        assert place.at is not None
        return _nearest_vertex(surface, place.name, np.asarray(place.at, dtype=float), unit)
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
    return place.vertex, 0.0


def _nearest_vertex(
    surface: trimesh.Trimesh, name: str, at: Array, unit: float
) -> tuple[int, float]:
    """Number of the vertex nearest to the point `at` [mesh unit], and its distance [m]."""
    point = f"target {name!r}: the point {_shown(at, unit)}"
    if not np.isfinite(at).all():
        raise UserError(f"{point} is not finite")
    off, side = _distance(surface, unit * at), longest_side(surface)
    if off > TOO_FAR * side:
        low, high = (_shown(corner / unit, unit) for corner in surface.bounds)
        advice = _other_unit(surface, unit * at)
        raise UserError(
            f"{point} is {off / side:.3g} times as far from the surface as that is long, expected "
            f"the mesh's own coordinates, from {low} to {high}"
            f"{advice or '; move it there'}"
        )
    vertices, used = np.asarray(surface.vertices, dtype=float), np.unique(surface.faces)
    away = np.linalg.norm(vertices[used] - unit * at, axis=1)
    nearest, distance = int(used[np.argmin(away)]), float(away.min())
    if off > OFF_SURFACE * side or distance > OFF_VERTEX * side:
        say(
            f"{point} is {off:.3g} m off the surface; the nearest vertex {nearest} at "
            f"{_shown(vertices[nearest] / unit, unit)} is struck, {distance:.3g} m away"
            f"{_other_unit(surface, unit * at)}"
        )
    return nearest, distance


def _distance(surface: trimesh.Trimesh, point: Array) -> float:
    """Distance [m] of a point (3,) [m] from the surface."""
    import igl

    vertices = np.ascontiguousarray(surface.vertices, dtype=float)
    faces = np.ascontiguousarray(surface.faces, dtype=np.int64)
    return float(np.sqrt(igl.point_mesh_squared_distance(point[None], vertices, faces)[0][0]))


def _other_unit(surface: trimesh.Trimesh, point: Array) -> str:
    """Words to add on a point (3,) [m] that would be on the surface in another unit, or nothing."""
    side = longest_side(surface)
    for factor in OTHER_UNITS:
        # Points close to the origin are on many surfaces, whatever they are multiplied by.
        tells = np.linalg.norm(factor * point) > OFF_VERTEX * side
        if tells and _distance(surface, factor * point) <= NEAR_IN_OTHER_UNIT * side:
            return f"; times {factor:.4g} it is on the surface: is it in another unit?"
    return ""


def _shown(point: Array, unit: float) -> str:
    """A point (3,) [mesh unit] and its unit."""
    numbers = ", ".join(f"{x:.4g}" for x in point)
    return f"({numbers}) {'m' if unit == 1.0 else 'mesh units'}"
