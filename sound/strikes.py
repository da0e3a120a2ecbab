"""The struck surface, that of a mesh refined to have a vertex near every point, and its points."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from carillon.arrays import Array, Index, Surface
from carillon.command_line.progress import say
from carillon.errors import UserError
from carillon.fem.geometry.size import length_in_words
from carillon.fem.geometry.walls import WallSize
from solver.response.vertices import inward_normals

OFF_SURFACE = 1e-3
"""Distance from the surface, over the surface's longest side, from which it is told that a point is
moved: coordinates are rounded."""
OFF_VERTEX = 0.05
"""Distance from the nearest vertex, over the longest side, from which that is told: more than any
point of `sound.strikes.struck_surface` is from one."""
TOO_FAR = 0.5
"""Distance from the surface, over the longest side, beyond which a point is a mistake."""
OTHER_UNITS = (1e-3, 1e3, 1e-2, 1e2, 0.0254, 1.0 / 0.0254)
"""Factors between units that people mix up."""
NEAR_IN_OTHER_UNIT = 0.02
"""Distance from the surface, over the longest side, that shows a point to be in another unit."""
BORDER_EDGE = 1.0 / 100.0
"""The same of an edge between parts of different materials."""
SAME_PLACE = 1e-6
"""Distance, over the longest side, within which two vertices are at one place."""
LONGEST_EDGE = 1.0 / 16.0
"""Greatest length of an edge, over the surface's longest side; longer edges are halved."""


@dataclass(frozen=True)
class Strike:
    """A struck vertex of the surface, with the name of the target whose clip is to sound there.

    The vertex has a position (3,) [m] and a unit vector `inward` (3,) into the solid; `distance`
    [m] is that from the position that was named, 0 if none was.
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


def locate_all(surface: Surface, places: Sequence[Place], unit: float = 1.0) -> list[Strike]:
    """The vertices that are struck for some targets, and the directions into the solid there.

    A line of progress tells how far a position is off the surface.  Vertices of this, in metres,
    may be repeated, and triangles may face either way; `unit` [m] is that of the mesh's own
    coordinates.  Raises UserError with a sentence for each target whose position is further than
    `TOO_FAR` from the surface or whose vertex is not there, and for any two at one place.
    """
    vertices, side = np.asarray(surface.vertices, dtype=float), longest_side(surface)
    struck: list[tuple[str, int, float]] = []
    faults: list[str] = []
    for place in places:
        try:
            struck.append((place.name, *vertex_of(surface, place, unit)))
        except UserError as error:
            faults.append(str(error))
    for (one, first, _), (other, second, _) in combinations(struck, 2):
        if np.linalg.norm(vertices[first] - vertices[second]) <= SAME_PLACE * side:
            at = _shown(vertices[first] / unit, unit)
            faults.append(
                f"targets {one!r} and {other!r} are both at vertex {first}, {at}; move one of "
                "them or leave it out"
            )
    if faults:
        raise UserError(*faults)
    positions = vertices[[number for _, number, _ in struck]]
    inward = inward_normals(surface, positions)
    return [
        Strike(name, number, position, normal, distance)
        for (name, number, distance), position, normal in zip(struck, positions, inward)
    ]


def vertex_of(surface: Surface, place: Place, unit: float) -> tuple[int, float]:
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


def _nearest_vertex(surface: Surface, name: str, at: Array, unit: float) -> tuple[int, float]:
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
            f"{point} is {length_in_words(off)} off the surface; the nearest vertex {nearest} at "
            f"{_shown(vertices[nearest] / unit, unit)} is struck, {length_in_words(distance)} away"
            f"{_other_unit(surface, unit * at)}"
        )
    return nearest, distance


def _distance(surface: Surface, point: Array) -> float:
    import igl

    vertices = np.ascontiguousarray(surface.vertices, dtype=float)
    faces = np.ascontiguousarray(surface.faces, dtype=np.int64)
    return float(np.sqrt(igl.point_mesh_squared_distance(point[None], vertices, faces)[0][0]))


def _other_unit(surface: Surface, point: Array) -> str:
    """Words to add on a point (3,) [m] that would be on the surface in another unit, or nothing."""
    side = longest_side(surface)
    for factor in OTHER_UNITS:
        # Points close to the origin are on many surfaces, whatever they are multiplied by.
        tells = np.linalg.norm(factor * point) > OFF_VERTEX * side
        if tells and _distance(surface, factor * point) <= NEAR_IN_OTHER_UNIT * side:
            return f"; times {factor:.4g} it is on the surface: is it in another unit?"
    return ""


def _shown(point: Array, unit: float) -> str:
    numbers = ", ".join(f"{x:.4g}" for x in point)
    return f"({numbers}) {'m' if unit == 1.0 else 'mesh units'}"


def struck_surface(
    mesh: str,
    unit: float = 1.0,
    parts_of: Callable[[Array, Index], Index] | None = None,
    wall: WallSize | None = None,
    up: str | None = None,
) -> Surface:
    """Surface of a mesh in metres, without edges above `LONGEST_EDGE` of its longest side.

    Where numbers (V,) change that `parts_of` gives to its vertices and triangles, `BORDER_EDGE`
    counts.

    The mesh's own vertices come first and keep their numbers; `carillon.fem.geometry.load_surface`
    describes it, its unit and the axis `up`.  Of a `wall` it is both sides, and these vertices are
    on the outer one. Raises UserError if there is no such mesh.
    """
    import trimesh

    from carillon.fem.geometry import load_surface

    surface = load_surface(mesh, unit, up=up) if wall is None else wall.read(mesh, unit, up).skin
    side = longest_side(surface)
    vertices, faces = np.asarray(surface.vertices), np.asarray(surface.faces)
    cut = _cut(vertices, faces, LONGEST_EDGE * side)
    if parts_of is not None:
        cut = _cut(*cut, BORDER_EDGE * side, parts_of)
    return trimesh.Trimesh(*cut, process=False)


def longest_side(surface: Surface) -> float:
    """Longest side [m] of the bounding box."""
    return float(np.max(surface.extents))


def _cut(
    vertices: Array,
    faces: Index,
    longest: float,
    parts_of: Callable[[Array, Index], Index] | None = None,
) -> tuple[Array, Index]:
    """Halve edges longer than `longest` in all triangles that share them, until there are none.

    Those of triangles of one part stay.
    """
    while True:
        ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2)
        sides = np.sort(ends.reshape(-1, 2), axis=1)
        edges, of_sides = np.unique(sides, axis=0, return_inverse=True)
        first, second = vertices[edges[:, 0]], vertices[edges[:, 1]]
        long = np.linalg.norm(second - first, axis=1) > longest
        if parts_of is not None:
            part = parts_of(vertices, faces)[faces]
            mixed = (part != part[:, :1]).any(axis=1)
            of_mixed = np.zeros(len(edges), dtype=bool)
            of_mixed[of_sides.reshape(-1, 3)[mixed]] = True
            long &= of_mixed
        if not long.any():
            return vertices, faces
        middles = np.full(len(edges), -1)
        middles[long] = len(vertices) + np.arange(np.count_nonzero(long))
        vertices = np.concatenate([vertices, (first + second)[long] / 2.0])
        faces = _with_middles(faces, middles[of_sides].reshape(-1, 3))


def _with_middles(faces: Index, middles: Index) -> Index:
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
