"""Edges along which a solid touches itself, where nothing holds it together.

Around such an edge of the mesh, solid and void alternate more than once. Voxels and finite cells
that both sides have a share in would join them.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from carillon.fem.geometry.facets import Facets, connected
from carillon.fem.geometry.overlap import joined
from carillon.fem.geometry.parts import ClosedPart, winding_numbers

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Flags = NDArray[np.bool_]

FAR = 0.1
"""Way along the surface, over the longest side, between the two sides of an edge up to which they
are held together beside it."""
COINCIDENT = 1e-6
"""Angle [rad] around an edge within which two triangles lie on each other."""
NEAR = 0.05
"""Distance from an edge, over the longest side, within which parts that overlap hold its sides."""
BESIDE = 1e-4
"""Distance of points beside an edge, over its length."""
INSIDE = 0.5
"""Winding number of points in the solid."""
MOST_EDGES = 1000
"""Edges that are looked at for being held together beside them."""
AT_ONCE = 10_000_000
"""Ways that are held at once."""
MOST_OVERLAPS = 50
"""Edges that are looked at for parts that overlap near them."""
MOST_PARTS = 20
"""Parts near an edge that are looked at for overlaps."""


def pinch(facets: Facets) -> Array | None:
    """Middle (3,) of an edge along which a solid touches itself; None if there is none.

    Parameters
    ----------
    facets
        The whole surface as one sheet, its faces turned alike. Triangles that are there both ways
        are walls inside the solid and do not count.
    """
    there = facets.of_face >= 0
    times = np.bincount(facets.of_face[there], facets.along[there], minlength=len(facets))
    sides = _Sides.of_triangles(facets, np.flatnonzero(times), np.sign(times).astype(np.int64))
    if not len(sides.crowded):
        return None
    contacts = _contacts(facets, sides)
    if not len(contacts.length):
        return None
    far = np.flatnonzero(contacts.ways(facets, sides) > FAR)
    for each in far[:: -(-len(far) // MOST_OVERLAPS) or 1]:
        if not _held_by_overlap(facets, sides, contacts, each):
            return facets.vertices[contacts.ends[each]].mean(axis=0)
    return None


@dataclass(frozen=True)
class _Sides:
    """Sides of triangles, three for each, 01, 12 and 20.

    Attributes
    ----------
    own : (t,)
        Triangles of the surface that count.
    sign : (triangles of the surface,)
        1 for those that are as they are turned, -1 for others, 0 for those that do not count.
    edge, way : (3 t,)
        Edge of each side, and 1 if it passes it from the end with the lower number.
    ends : (e, 2)
        Vertices of the edges, the lower first.
    pairs : (k, 2)
        Sides that alone share an edge.
    crowded : (s,)
        Sides of edges of three triangles or more.
    """

    own: Index
    sign: Index
    edge: Index
    way: Index
    ends: Index
    pairs: Index
    crowded: Index

    @classmethod
    def of_triangles(cls, facets: Facets, own: Index, sign: Index) -> _Sides:
        corners = facets.triangles[own]
        pairs = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2)
        low, high = pairs.min(axis=1), pairs.max(axis=1)
        keys = low * len(facets.vertices) + high
        _, first, edge, counts = np.unique(
            keys, return_index=True, return_inverse=True, return_counts=True
        )
        two = np.flatnonzero(counts[edge] == 2)
        two = two[np.argsort(edge[two], kind="stable")].reshape(-1, 2)
        ends = np.stack([low[first], high[first]], axis=1)
        way = np.where(pairs[:, 0] == low, 1, -1)
        return cls(own, sign, edge, way, ends, two, np.flatnonzero(counts[edge] > 2))

    def corners(self, side: Index) -> Index:
        """Corners (k, 2) of all triangles at the lower and the higher end of sides (k,)."""
        start, end = side, side - side % 3 + (side + 1) % 3
        up = self.way[side] > 0
        return np.stack([np.where(up, start, end), np.where(up, end, start)], axis=1)


@dataclass(frozen=True)
class _Contacts:
    """Edges around which solid and void alternate more than once.

    Attributes
    ----------
    fan : (3 t,)
        Fan of each corner: those of triangles that go round a vertex together are one.
    ends : (k, 2)
        Vertices of the edges.
    length : (k,)
        Of the edges.
    one, other : (k,)
        A side at one solid and at another.
    """

    fan: Index
    ends: Index
    length: Array
    one: Index
    other: Index

    @property
    def links(self) -> Index:
        """Fans (3 t, 2) at the ends of each side."""
        after = np.roll(self.fan.reshape(-1, 3), -1, axis=1)
        return np.stack([self.fan, after.ravel()], axis=1)

    def ways(self, facets: Facets, sides: _Sides) -> Array:
        """Lengths (k,) of ways along edges of the mesh from one solid's side to the other's.

        From the middle of the edge to the middle; infinite if longer than `FAR`.
        """
        from scipy.sparse.csgraph import dijkstra  # Its import takes long.

        pairs, first = np.unique(np.sort(self.links, axis=1), axis=0, return_index=True)
        ends = facets.vertices[sides.ends[sides.edge[first]]]
        count = int(self.fan.max()) + 1
        graph = sp.csr_matrix(
            (np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), pairs.T), shape=(count, count)
        )
        found = np.full(len(self.length), np.inf)
        step = max(AT_ONCE // (2 * count), 1)
        short = np.flatnonzero(self.length <= FAR)
        for some in np.split(short, np.arange(step, len(short), step)):
            starts = self.fan[sides.corners(self.one[some])]
            stops = self.fan[sides.corners(self.other[some])]
            away = dijkstra(graph, directed=False, indices=starts.ravel(), limit=FAR)
            away = away.reshape(len(some), 2, count)
            reached = np.take_along_axis(away, stops[:, None], axis=2).min(
                axis=(1, 2), initial=np.inf
            )
            found[some] = self.length[some] + reached
        return found


def _contacts(facets: Facets, sides: _Sides) -> _Contacts:
    """Edges of the mesh around which solid and void alternate more than once."""
    side, after, solid, flat = _sectors(facets, sides)
    linked = solid | flat
    run = connected(len(side), np.flatnonzero(linked), after[linked])
    corners = [
        (sides.corners(left), sides.corners(right))
        for left, right in (
            (sides.pairs[:, 0], sides.pairs[:, 1]),
            (side[linked], side[after[linked]]),
        )
    ]
    left, right = (np.concatenate(each).ravel() for each in zip(*corners))
    fan = connected(3 * len(sides.own), left, right)
    first = np.flatnonzero(solid)
    first = first[np.unique(run[first], return_index=True)[1]]
    first = first[np.argsort(sides.edge[side[first]], kind="stable")]
    edge = sides.edge[side[first]]
    again = np.flatnonzero(edge[1:] == edge[:-1])
    again = again[:: -(-len(again) // MOST_EDGES) or 1]
    ends = sides.ends[edge[again]]
    length = np.linalg.norm(np.diff(facets.vertices[ends], axis=1)[:, 0], axis=1)
    return _Contacts(fan, ends, length, side[first[again]], side[first[again + 1]])


def _sectors(facets: Facets, sides: _Sides) -> tuple[Index, Index, Flags, Flags]:
    """What is around the edges of three triangles or more.

    Returns
    -------
    side : (s,)
        Sides of triangles at each edge, in order of their angle around it.
    after : (s,)
        Which of these follows on each.
    solid : (s,)
        Whether the sector between the two is solid.
    flat : (s,)
        Whether the two lie on each other.
    """
    side = sides.crowded
    ends = facets.vertices[sides.ends[sides.edge[side]]]
    start, along = ends[:, 0], ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1)
    along /= length[:, None]
    across = np.cross(along, np.eye(3)[np.abs(along).argmin(axis=1)])
    across /= np.linalg.norm(across, axis=1)[:, None]
    up = np.cross(along, across)
    third = facets.triangles[sides.own[side // 3], (side + 2) % 3]
    arm = facets.vertices[third] - start
    angle = np.arctan2((arm * up).sum(axis=1), (arm * across).sum(axis=1))
    order = np.lexsort((angle, sides.edge[side]))
    side, angle, across, up, length = (x[order] for x in (side, angle, across, up, length))
    edge = sides.edge[side]
    first = np.flatnonzero(np.diff(edge, prepend=-1))
    group = np.repeat(np.arange(len(first)), np.diff(np.append(first, len(side))))
    after = np.arange(1, len(side) + 1)
    last = np.append(first[1:], len(side)) - 1
    after[last] = first
    gap = angle[after] - angle
    gap[last] += 2.0 * np.pi
    # A point in the widest sector tells its winding number; each triangle steps by one.
    widest = np.lexsort((-gap, group))[first]
    turn = angle[widest] + 0.5 * gap[widest]
    arm = np.cos(turn)[:, None] * across[widest] + np.sin(turn)[:, None] * up[widest]
    middle = facets.vertices[sides.ends[edge[widest]]].mean(axis=1)
    points = middle + BESIDE * length[widest, None] * arm
    number = winding_numbers(facets, np.arange(len(facets)), points, sides.sign)
    total = np.cumsum(-sides.way[side] * sides.sign[sides.own[side // 3]])
    number = number[group] + total - total[widest][group]
    return side, after, np.abs(number) > INSIDE, gap < COINCIDENT


def _held_by_overlap(facets: Facets, sides: _Sides, contacts: _Contacts, each: int) -> bool:
    """Whether parts of the surface that overlap near an edge may hold its two sides together.

    No way along edges leads from one such part to another.
    """
    label = connected(int(contacts.fan.max()) + 1, *contacts.links.T)[contacts.fan[::3]]
    volume = np.bincount(label, _cones(facets, sides))
    outward = 1.0 if volume.sum() >= 0.0 else -1.0
    one, other = label[contacts.one[each] // 3], label[contacts.other[each] // 3]
    start, end = facets.vertices[contacts.ends[each]]
    for share in np.linspace(0.0, 1.0, int(contacts.length[each] / NEAR) + 2):
        middle = start + share * (end - start)
        within = middle - NEAR, middle + NEAR
        # Cavities hold nothing.
        near = [own for own in np.flatnonzero(outward * volume > 0.0) if own not in (one, other)]
        parts = {own: _part(facets, sides, label == own) for own in (one, other, *near)}
        near = [own for own in near if _meets(parts[own], within)]
        if one == other:
            if any(joined(facets, parts[one], parts[own], within) for own in near):
                return True
            continue
        among = [one, other, *near][:MOST_PARTS]
        pairs = [
            (i, j)
            for i, j in combinations(range(len(among)), 2)
            if joined(facets, parts[among[i]], parts[among[j]], within)
        ]
        if pairs:
            body = connected(len(among), *np.array(pairs).T)
            if body[0] == body[1]:
                return True
    return False


def _cones(facets: Facets, sides: _Sides) -> Array:
    """Volumes (t,) of cones over triangles, six times."""
    corners = facets.vertices[facets.triangles[sides.own, 0]]
    return np.einsum("ti,ti->t", corners, facets.normals[sides.own]) * sides.sign[sides.own]


def _meets(part: ClosedPart, within: tuple[Array, Array]) -> bool:
    return bool((part.low <= within[1]).all() and (part.high >= within[0]).all())


def _part(facets: Facets, sides: _Sides, chosen: Flags) -> ClosedPart:
    own = sides.own[chosen]
    corners = facets.vertices[facets.triangles[own]].reshape(-1, 3)
    return ClosedPart(own, 0.0, corners.min(axis=0), corners.max(axis=0))
