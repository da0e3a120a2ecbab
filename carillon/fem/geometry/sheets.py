"""Both sides of a surface's triangles, and how they go on around the edges.

A side is number 2 t of triangle t for the one that its normal points to, 2 t + 1 for the other.
Around an edge the sides that face each other go on in each other, whether two triangles meet there
or three; at a rim, where there is one, its two sides do.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numba
import numpy as np

from carillon.arrays import Array, Flags, Index
from carillon.fem.geometry.facets import Facets

FLATTEST = 1e-7
"""Height of a triangle, over the surface's longest side, up to which it counts as a line."""
TOUCHING = 1e-6
"""Distance of a rim from another triangle, over that side, up to which they are joined."""
RIM_POINTS = np.array([0.05, 0.5, 0.95])
"""Places along a rim's edge that all have to touch other triangles."""


@dataclass(frozen=True)
class Gaps:
    """Spaces between triangles that follow each other around an edge; one of a turn at a rim."""

    ends: Index
    """(g, 2) vertices of the edge, by number."""
    side: Index
    """(g, 2) sides that face each other, the second one counter-clockwise from the first."""
    halves: Index
    """(g, 2) half-edges, 3 t + k, of their triangles."""
    angle: Array
    """(g,) between them, 0 to 2 pi."""
    is_rim: Flags
    """(g,)"""


@dataclass(frozen=True)
class Sheets:
    """Triangles of a surface, none twice and none without an area."""

    vertices: Array
    """(v, 3) over the longest side of the surface, from its lowest corner."""
    triangles: Index
    """(t, 3)"""
    own: Index
    """(t, 3) vertices of the surface itself at their corners, which it may have several of."""
    is_closed: bool
    """Whether triangles, those without an area with them, meet in twos that are turned alike."""

    @classmethod
    def of_surface(cls, vertices: Array, faces: Index) -> Sheets:
        """Those of a surface with vertices (v, 3) and faces (f, 3)."""
        facets = Facets.of_surface(vertices, faces)
        corners = facets.vertices[facets.triangles]
        longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        kept = 2.0 * facets.areas > FLATTEST * longest
        there = np.flatnonzero((facets.of_face >= 0) & (facets.along > 0))[::-1]
        face = np.zeros(len(facets), dtype=np.int64)
        face[facets.of_face[there]] = there
        own = _in_order(vertices, faces[face], corners)
        is_closed = bool((facets.edges[2] == 2).all() and facets.links[2].all())
        return cls(facets.vertices, facets.triangles[kept], own[kept], is_closed)

    def __len__(self) -> int:
        return len(self.triangles)

    @cached_property
    def corners(self) -> Array:
        """Corners (t, 3, 3)."""
        return self.vertices[self.triangles]

    @cached_property
    def normals(self) -> Array:
        """Unit normals (t, 3)."""
        a, b, c = np.moveaxis(self.corners, 1, 0)
        normals = np.cross(b - a, c - a)
        return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))

    @cached_property
    def along(self) -> Array:
        """Unit vectors (3 t, 3) along the half-edges, counter-clockwise."""
        edges = np.roll(self.corners, -1, axis=1) - self.corners
        return np.asarray((edges / np.linalg.norm(edges, axis=2, keepdims=True)).reshape(-1, 3))

    @cached_property
    def inward(self) -> Array:
        """Unit vectors (3 t, 3) across the half-edges, in the plane of the triangle into it."""
        return np.cross(np.repeat(self.normals, 3, axis=0), self.along)

    def outward(self, side: Index) -> Array:
        """Unit normals (s, 3) of sides (s,)."""
        return np.asarray(self.normals[side // 2] * (1 - 2 * (side % 2))[:, None])

    @property
    def volume(self) -> float:
        """Signed volume that a closed surface encloses, positive if normals point outwards."""
        return float(np.linalg.det(self.corners).sum()) / 6.0

    @cached_property
    def is_turned_alike(self) -> bool:
        """Whether triangles that alone share an edge pass it in opposite ways."""
        gaps = self.gaps
        pairs = ~gaps.is_rim
        return bool((gaps.side[pairs, 0] % 2 == gaps.side[pairs, 1] % 2)[self._alone[pairs]].all())

    @cached_property
    def gaps(self) -> Gaps:
        """All gaps, those of an edge after each other."""
        return self._around[0]

    @property
    def _alone(self) -> Flags:
        """Gaps (g,) at edges of two triangles."""
        return self._around[1]

    @cached_property
    def _around(self) -> tuple[Gaps, Flags]:
        starts, ends = self.triangles.ravel(), np.roll(self.triangles, -1, axis=1).ravel()
        low, high = np.minimum(starts, ends), np.maximum(starts, ends)
        edge = np.unique(low * len(self.vertices) + high, return_inverse=True)[1]
        way = np.where(starts < ends, 1, -1)
        # Angles about the edge, from its lower end to the higher, from its first triangle on.
        first = np.unique(edge, return_index=True)[1][edge]
        axis = way[:, None] * self.along
        x = self.inward[first]
        y = np.cross(axis, x)
        angle = np.arctan2((self.inward * y).sum(axis=1), (self.inward * x).sum(axis=1))
        angle = np.mod(angle, 2.0 * np.pi)
        angle[first == np.arange(len(edge))] = 0.0
        order = np.lexsort((angle, edge))
        start = np.searchsorted(edge[order], edge[order])
        count = np.bincount(edge)[edge[order]]
        place = np.arange(len(order))
        is_last = place - start + 1 == count
        follows = order[np.where(is_last, start, place + 1)]
        between = angle[follows] - angle[order] + np.where(is_last, 2.0 * np.pi, 0.0)
        # The normal is a quarter of a turn ahead of a triangle that passes the edge upwards.
        ahead = 2 * (order // 3) + (way[order] < 0)
        behind = 2 * (follows // 3) + (way[follows] > 0)
        gaps = Gaps(
            np.stack([low[order], high[order]], axis=1),
            np.stack([ahead, behind], axis=1),
            np.stack([order, follows], axis=1),
            between,
            count == 1,
        )
        return gaps, count == 2

    @cached_property
    def joined_rims(self) -> Flags:
        """Gaps (g,) at rims that lie on other triangles, with which no edge is shared."""
        gaps = self.gaps
        found = np.zeros(len(gaps.angle), dtype=bool)
        rims = np.flatnonzero(gaps.is_rim)
        ends = self.vertices[gaps.ends[rims]]
        share = RIM_POINTS[:, None]
        points = ends[:, None, 0] * (1.0 - share) + ends[:, None, 1] * share
        lowest = self.corners[:, :, 0].min(axis=1)
        reach = float(np.ptp(self.corners[:, :, 0], axis=1).max(initial=0.0))
        order = np.argsort(lowest, kind="stable")
        found[rims] = _touch(
            points, gaps.halves[rims, 0] // 3, order, lowest[order], reach, self.corners, TOUCHING
        )
        return found


def _in_order(vertices: Array, faces: Index, corners: Array) -> Index:
    """Faces (t, 3) begun at that vertex which is the first of the corners (t, 3, 3)."""
    low, high = vertices[faces].min(axis=(0, 1)), vertices[faces].max(axis=(0, 1))
    scaled = (vertices[faces] - low) / (high - low).max()
    first = ((scaled - corners[:, :1]) ** 2).sum(axis=2).argmin(axis=1)
    return np.take_along_axis(faces, (first[:, None] + np.arange(3)) % 3, axis=1)


@numba.njit(cache=True, nogil=True)
def _touch(points, own, order, lowest, reach, corners, tolerance):  # type: ignore[no-untyped-def]
    """Which rows (r,) of points (r, p, 3) all lie on triangles other than their own."""
    result = np.zeros(len(points), dtype=np.bool_)
    for row in range(len(points)):
        all_touch = True
        for number in range(points.shape[1]):
            point = points[row, number]
            touches = False
            first = np.searchsorted(lowest, point[0] - reach - tolerance)
            for place in range(first, len(order)):
                if lowest[place] > point[0] + tolerance:
                    break
                triangle = order[place]
                if triangle != own[row] and _is_on(point, corners[triangle], tolerance):
                    touches = True
                    break
            if not touches:
                all_touch = False
                break
        result[row] = all_touch
    return result


@numba.njit(cache=True, nogil=True)
def _is_on(point, corners, tolerance):  # type: ignore[no-untyped-def]
    for axis in range(3):
        a, b, c = corners[0, axis], corners[1, axis], corners[2, axis]
        if point[axis] < min(a, b, c) - tolerance or point[axis] > max(a, b, c) + tolerance:
            return False
    normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    normal /= np.sqrt((normal**2).sum())
    if abs((normal * (point - corners[0])).sum()) > tolerance:
        return False
    for k in range(3):
        along = corners[(k + 1) % 3] - corners[k]
        inward = np.cross(normal, along / np.sqrt((along**2).sum()))
        if (inward * (point - corners[k])).sum() < -tolerance:
            return False
    return True
