"""Where a solid is held, rests on pads, or carries masses, in any discretisation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array, Flags, Index, Surface
from carillon.composition.places import ClosedSurface, Where
from carillon.errors import UserError
from carillon.fem.embedding import embedding
from carillon.fem.finite_cells.model import FiniteCellModel
from carillon.fem.geometry.size import length_in_words
from carillon.fem.model import Solid
from carillon.fem.supports import Supports

HELD = 1e3
"""Stiffness of the spring at a held point, in multiples of modulus times lattice spacing. What is
held moves by a thousandth of what one spacing of the solid is strained."""
LEAST = 1e-6
"""Least share of a cell inside the solid by which springs there are softer."""
SAMPLE = 0.5
"""Largest edge of the triangles whose middles stand for a surface, in lattice spacings."""
SLIGHT = 1e-6
"""Distance outside a surface, in sides of the solid, at which it is asked for, too: a face is of
what begins there."""
REACH = 1.5
"""Largest distance of a named point outside the solid, in lattice spacings."""
ALL = (True, True, True)


@dataclass(frozen=True)
class Support:
    """A part of the solid, or a point of it, that is held, springy or heavy."""

    label: str
    """What it is called in messages."""
    domain: Where | None = None
    point: tuple[float, float, float] | None = None
    """Where it is: all of the solid in a domain, or a point [m]."""
    axes: tuple[bool, bool, bool] = ALL
    """Which of x, y, z it acts along."""
    spring: Array | None = None
    """Springs in place of holding it: a number or (3, 3) [N/m] at a point, [N/m^3] by area."""
    mass: float = 0.0
    """Mass [kg] that is fixed there, which does not hold it."""
    pad: tuple[float, float] | None = None
    """Springs [N/m^3] by area across and along the surface, in place of `spring`."""


def placed_supports(
    parts: Sequence[Support], solid: Solid, surface: Surface, name: str = "mesh"
) -> Supports | None:
    """Supports at points of a discretised solid; None without any.

    Raises UserError for a support that meets nothing of the solid, or if nothing is left to move.

    Parameters
    ----------
    solid
        In its finest discretisation, whose spacing says how closely points lie.
    surface
        Triangles around it [m].
    """
    if not parts:
        return None
    samples = _Samples.of_surface(surface, SAMPLE * solid.mesh.edge)
    found = [_placed(part, solid, surface, samples, name) for part in parts]
    supports = Supports.together(found)
    _require_movable(parts, solid, name)
    return supports


@dataclass(frozen=True)
class _Samples:
    """Points of a surface, each with the area it stands for."""

    points: Array
    normals: Array
    areas: Array
    """(s, 3), (s, 3), (s,) [m^2]."""
    corners: Array
    """(v, 3) [m] corners of the triangles that the points are the middles of."""
    size: float
    """Longest side of the surface [m]."""

    @classmethod
    def of_surface(cls, surface: Surface, longest: float) -> _Samples:
        import trimesh  # Its import takes long.

        vertices, faces = trimesh.remesh.subdivide_to_size(
            surface.vertices, surface.faces, max_edge=longest, max_iter=40
        )
        corners = np.asarray(vertices)[np.asarray(faces)]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(across, axis=1)
        kept = length > 0.0
        normals = across[kept] / length[kept, None]
        size = float(np.ptp(np.asarray(surface.bounds), axis=0).max())
        middles, areas = corners[kept].mean(axis=1), 0.5 * length[kept]
        return cls(middles, normals, areas, np.asarray(vertices), size)

    def inside(self, domain: Where) -> Index:
        """Numbers of those in a domain, or at its border."""
        slightly = SLIGHT * self.size * self.normals
        near = [domain.contains(self.points + side * slightly) for side in (0.0, 1.0, -1.0)]
        return np.flatnonzero(np.any(near, axis=0))


def _placed(
    part: Support, solid: Solid, surface: Surface, samples: _Samples, name: str
) -> Supports:
    if part.point is not None:
        return _at_point(part, solid, surface, name)
    assert part.domain is not None
    own = samples.inside(part.domain)
    along = np.diag(np.asarray(part.axes, dtype=float))
    if part.spring is not None or part.pad is not None:
        if not len(own):
            raise _misses(part, samples, name, "the surface of ")
        areas = samples.areas[own, None, None]
        if part.pad is not None:
            across, sliding = part.pad
            normal = samples.normals[own]
            outer = normal[:, :, None] * normal[:, None, :]
            by_area = across * outer + sliding * (np.eye(3) - outer)
        else:
            by_area = np.broadcast_to(np.asarray(part.spring) * np.eye(3), (len(own), 3, 3))
        springs = areas * (along @ by_area @ along)
        return Supports(samples.points[own], springs, np.zeros(len(own)))
    nodes = solid.positions[np.unique(solid.connectivity)]
    nodes = nodes[part.domain.contains(nodes)]
    # Held beyond the surface and on it, a face would be kept from turning, too.
    nodes = nodes[_is_in_solid(nodes, surface, samples.size)]
    corners = samples.corners[part.domain.contains(samples.corners)]
    points = np.concatenate([nodes, samples.points[own], corners])
    if not len(points):
        raise _misses(part, samples, name)
    if part.mass:
        return Supports(points, np.zeros((len(points), 3, 3)), _spread(part.mass, len(points)))
    springs = _stiff(solid, points)[:, None, None] * along
    return Supports(points, springs, np.zeros(len(points)))


def _spread(mass: float, count: int) -> Array:
    return np.full(count, mass / count)


def _is_in_solid(points: Array, surface: Surface, size: float) -> Flags:
    """Which points (p, 3) [m] are in the solid, or on its surface."""
    inside = ClosedSurface(surface).contains(points)
    others = np.flatnonzero(~inside)
    if len(others):
        distance, _ = _nearest(points[others], surface)
        inside[others] = distance <= SLIGHT * size
    return inside


def _nearest(points: Array, surface: Surface) -> tuple[Array, Array]:
    """Distances (p,) [m] from a surface, and its nearest points (p, 3)."""
    import igl

    faces = np.ascontiguousarray(surface.faces, dtype=np.int64)
    vertices = np.ascontiguousarray(surface.vertices)
    found = igl.point_mesh_squared_distance(np.ascontiguousarray(points), vertices, faces)
    return np.sqrt(np.ravel(found[0])), np.reshape(found[2], (-1, 3))


def _at_point(part: Support, solid: Solid, surface: Surface, name: str) -> Supports:
    assert part.point is not None
    point = _in_solid(part, np.array(part.point, dtype=float), solid, surface, name)
    along = np.diag(np.asarray(part.axes, dtype=float))
    if part.mass:
        springs = np.zeros((3, 3))
    elif part.spring is None:
        springs = _stiff(solid, point[None])[0] * along
    else:
        springs = along @ (np.asarray(part.spring) * np.eye(3)) @ along
    return Supports(point[None], springs[None], np.array([part.mass]))


def _in_solid(part: Support, point: Array, solid: Solid, surface: Surface, name: str) -> Array:
    """A point (3,) [m] if it is in the solid, or the nearest one of the surface."""
    if ClosedSurface(surface).contains(point[None])[0]:
        return point
    distances, places = _nearest(point[None], surface)
    distance, place = float(distances[0]), places[0]
    if distance > REACH * solid.mesh.edge:
        shown, other = (", ".join(f"{value:.4g}" for value in each) for each in (point, place))
        raise UserError(
            f"{part.label}: the point ({shown}) m is {length_in_words(distance)} off solid "
            f"{name!r}; expected one of it, the nearest is ({other}) m"
        )
    return np.asarray(place)


def _stiff(solid: Solid, points: Array) -> Array:
    """Stiffness (p,) [N/m] of springs that hold points (p, 3) [m].

    In cells of which little is inside they are as much softer, as these are themselves: beside far
    stiffer springs they would lose their digits.
    """
    whole = HELD * float(np.max(solid.young)) * solid.mesh.edge
    share = np.ones(len(points))
    if isinstance(solid, FiniteCellModel):
        own, _ = embedding(solid.with_supports(None), points)
        share = np.maximum(solid.cells.fractions[own], LEAST)
    return whole * share


def _misses(part: Support, samples: _Samples, name: str, of: str = "") -> UserError:
    low, high = samples.points.min(axis=0), samples.points.max(axis=0)
    box = " and ".join(
        f"{low[axis]:.4g} <= {letter} <= {high[axis]:.4g}" for axis, letter in enumerate("xyz")
    )
    return UserError(f"{part.label} meets nothing of {of}solid {name!r}, which has {box} [m]")


def _require_movable(parts: Sequence[Support], solid: Solid, name: str) -> None:
    """Refuse supports that hold all of the solid."""
    nodes = solid.positions[np.unique(solid.connectivity)]
    held = np.zeros((len(nodes), 3), dtype=bool)
    for part in parts:
        springy = part.spring is not None or part.pad is not None
        if part.domain is None or springy or part.mass:
            continue
        held |= part.domain.contains(nodes)[:, None] & np.asarray(part.axes)
    if held.all():
        raise UserError(
            f"all of solid {name!r} is held: nothing is left that vibrates; hold less of it"
        )
