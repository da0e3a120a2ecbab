"""Solids of revolution: the polygon that turns about z, and their surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array, Index, Surface
from carillon.fem.geometry.sweep import outward

SECTIONS = 288
"""Segments of a full turn of a surface."""
STEPS = 24
"""Straight sides of a quarter circle in a profile: no shorter than elements of its thin wall."""
STRAIGHT = np.pi / 18.0
"""Angle between two sides up to which they make no corner."""
NEAR = 1e-9
"""Distance [m] within which points of a surface lie on a plane or an axis."""


@dataclass(frozen=True)
class Profile:
    """Closed polygon in the half-plane of radius and height."""

    points: Array
    """(k, 2) [m], radius first; a polygon that touches the axis has a side on it."""

    @property
    def is_ring(self) -> bool:
        """Whether the polygon stays off the axis."""
        return bool(self.points[:, 0].min() > NEAR)

    @property
    def notches(self) -> Index:
        """Corners that point into the solid, by more than `STRAIGHT`."""
        before = self.points - np.roll(self.points, 1, axis=0)
        after = np.roll(before, -1, axis=0)
        turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        angle = np.arctan2(turn, (before * after).sum(axis=1))
        return np.flatnonzero(angle * np.sign(angle.sum()) < -STRAIGHT)

    @property
    def longest(self) -> float:
        """Longest side of the box around the solid [m]."""
        return float(max(2.0 * self.points[:, 0].max(), np.ptp(self.points[:, 1])))

    def distances(self, points: Array) -> Array:
        """Distances (n,) [m] of points (n, 3) from the surface."""
        flat = np.column_stack([np.hypot(points[:, 0], points[:, 1]), points[:, 2]])[:, None]
        start, end = self.points, np.roll(self.points, -1, axis=0)
        if not self.is_ring:  # The last side lies on the axis.
            start, end = start[:-1], end[:-1]
        along = ((flat - start) * (end - start)).sum(axis=2) / ((end - start) ** 2).sum(axis=1)
        nearest = start + np.clip(along, 0.0, 1.0)[:, :, None] * (end - start)
        return np.asarray(np.linalg.norm(flat - nearest, axis=2).min(axis=1))

    def surface(self, sections: int = SECTIONS) -> Surface:
        """Triangles of the turned polygon, which enclose the volume of the solid."""
        from trimesh.creation import revolve

        closed = np.vstack([self.points, self.points[:1]]) if self.is_ring else self.points
        surface = outward(revolve(closed, sections=sections))
        angle = 2.0 * np.pi / sections
        bulge = float(np.sqrt(angle / np.sin(angle)))
        return surface.apply_transform(np.diag([bulge, bulge, 1.0, 1.0]))


def profile_of(surface: Surface) -> Profile | None:
    """The polygon that a surface is turned from: its edges in y = 0, x >= 0.

    None if there are no such edges, or the surface is not the one that the polygon makes.

    Examples
    --------
    >>> from carillon.fem.geometry.builtin import builtin_surface
    >>> len(profile_of(builtin_surface("wine-glass")).points), profile_of(builtin_surface("box"))
    (19, None)
    """
    x, y, _ = surface.vertices.T
    there = (np.abs(y) < NEAR) & (x > -NEAR)
    edges = surface.edges_unique
    chain = _chain(edges[there[edges].all(axis=1)])
    if chain is None:
        return None
    points = np.maximum(surface.vertices[chain][:, [0, 2]], [0.0, -np.inf])
    distances = np.hypot(x, y)
    turned = np.column_stack([distances, surface.vertices[:, 2]])
    far = np.linalg.norm(turned[:, None] - points, axis=2).min(axis=1)
    return Profile(points) if far.max() < 1e3 * NEAR else None


def _chain(edges: Index) -> list[int] | None:
    """Vertices in the order in which edges (e, 2) join them; None if they branch or fall apart."""
    neighbours: dict[int, list[int]] = {}
    for a, b in edges.tolist():
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    counts = [len(each) for each in neighbours.values()]
    if not neighbours or max(counts) > 2:
        return None
    ends = [vertex for vertex, each in neighbours.items() if len(each) == 1]
    chain = [ends[0] if ends else next(iter(neighbours))]
    while further := [each for each in neighbours[chain[-1]] if each not in chain[-2:]]:
        if further[0] == chain[0]:
            break
        chain.append(further[0])
    return chain if len(chain) == len(neighbours) else None


def hemisphere(radius: float = 0.1, wall: float = 0.001) -> Profile:
    """Half of a spherical shell, open at the top."""
    angle = np.linspace(0.0, np.pi / 2.0, STEPS + 1)
    unit = np.column_stack([np.sin(angle), -np.cos(angle)])
    unit[0, 0] = 0.0
    outside, inside = radius * unit, (radius - wall) * unit
    return Profile(np.concatenate([outside, inside[::-1]]) + [0.0, radius])


def disc(radius: float = 0.1, wall: float = 0.001) -> Profile:
    """Round plate."""
    return _rectangle(0.0, radius, wall)


def ring(radius: float = 0.1, wall: float = 0.001, height: float = 0.06) -> Profile:
    """Open cylinder."""
    return _rectangle(radius - wall, radius, height)


def dumbbell(radius: float = 0.05, distance: float = 0.14, neck: float = 0.0105) -> Profile:
    """Two spheres whose middles are so far apart, joined by a neck."""
    last = np.pi - np.arcsin(neck / radius)
    angle = np.linspace(0.0, last, 2 * STEPS)
    lower = radius * np.column_stack([np.sin(angle), -np.cos(angle)]) - [0.0, 0.5 * distance]
    lower[0, 0] = 0.0
    return Profile(np.concatenate([lower, lower[::-1] * [1.0, -1.0]]))


def _rectangle(inner: float, outer: float, height: float) -> Profile:
    corners = [(inner, 0.0), (outer, 0.0), (outer, height), (inner, height)]
    return Profile(np.array(corners))
