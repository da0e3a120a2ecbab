"""The skin of a wall: its surface moved to both sides, and joined where it ends."""

from __future__ import annotations

import numpy as np

from carillon.arrays import Array, Index
from carillon.fem.geometry.facets import connected
from carillon.fem.geometry.sheets import Sheets

FARTHEST = 3.0
"""Distance, over the height of its sides, to which a corner of the skin is moved at most."""


def wall_skin(sheets: Sheets, low: float, high: float, count: int) -> tuple[Array, Index]:
    """Vertices (p, 3) and triangles (q, 3) around the wall from `low` to `high` along the normals.

    A corner of a triangle's side moves along the mean normal of the sides that go on there, so far
    that it lies in their moved planes, if one point does. So edges are sharp, and hollows narrower
    than the wall may turn inside out. Lengths are over the longest side of the surface.

    Parameters
    ----------
    count
        Vertices of the surface: the first ones of the skin are those, by number, on the side that
        normals point to. Where no triangle has one, its place is not a number.
    """
    group, moved = _moved_corners(sheets, low, high)
    # A vertex of the skin for each of the surface's own, so that seams stay, and each group.
    own = np.repeat(sheets.own, 2, axis=0)
    keys, first, number = np.unique(
        own.ravel() * len(moved) + group.ravel(), return_index=True, return_inverse=True
    )
    vertex = keys // len(moved)
    order = np.lexsort((first, first // 3 % 2, vertex))
    is_first = np.append(True, vertex[order][1:] != vertex[order][:-1])
    new = np.empty(len(keys), dtype=np.int64)
    new[order[is_first]] = vertex[order[is_first]]
    new[order[~is_first]] = count + np.arange(np.count_nonzero(~is_first))
    points = np.full((count + np.count_nonzero(~is_first), 3), np.nan)
    points[new] = moved[keys % len(moved)]
    corners = new[number].reshape(-1, 2, 3)
    outer, inner = corners[:, 0], corners[:, 1]
    halves = sheets.gaps.halves[sheets.gaps.is_rim, 0]
    triangle, begin = np.divmod(halves, 3)
    end = (begin + 1) % 3
    rims = [
        (outer[triangle, end], outer[triangle, begin], inner[triangle, begin]),
        (outer[triangle, end], inner[triangle, begin], inner[triangle, end]),
    ]
    faces = [outer, inner[:, ::-1], *(np.stack(rim, axis=1) for rim in rims)]
    return points, np.concatenate(faces)


def _moved_corners(sheets: Sheets, low: float, high: float) -> tuple[Index, Array]:
    """Group (2 t, 3) of each corner of the triangles' sides, and the place (g, 3) of each group.

    Corners are of one group where sides go on in each other around an edge.
    """
    gaps, count = sheets.gaps, len(sheets)
    is_rim = gaps.is_rim
    left, right = [], []
    for end in (0, 1):
        one, other = (
            3 * gaps.side[~is_rim, k]
            + _corner(sheets, gaps.halves[~is_rim, k], gaps.ends[~is_rim, end])
            for k in (0, 1)
        )
        left.append(one)
        right.append(other)
    group = connected(6 * count, np.concatenate(left), np.concatenate(right))
    weight = np.repeat(_angles(sheets), 2, axis=0).ravel()
    sides = np.repeat(np.arange(2 * count), 3)
    height = np.where(sides % 2 == 0, high, -low)
    total = np.bincount(group, weight)
    normal = sheets.outward(sides)
    sums = [np.bincount(group, weight * normal[:, axis]) for axis in range(3)]
    mean = np.stack(sums, axis=1) / total[:, None]
    reach = np.bincount(group, weight * height) / total
    length = np.maximum((mean**2).sum(axis=1), 1.0 / FARTHEST**2)
    place = np.empty((len(total), 3))
    place[group] = np.repeat(sheets.corners, 2, axis=0).reshape(-1, 3)
    return group.reshape(-1, 3), place + (reach / length)[:, None] * mean


def _corner(sheets: Sheets, halves: Index, vertex: Index) -> Index:
    """Which corner (h,) of their triangles vertices (h,) of half-edges (h,) are."""
    begins = sheets.triangles.ravel()[halves] == vertex
    return np.where(begins, halves % 3, (halves + 1) % 3)


def _angles(sheets: Sheets) -> Array:
    """Angles (t, 3) of the triangles at their corners."""
    along = sheets.along.reshape(-1, 3, 3)
    cosine = -(along * np.roll(along, 1, axis=1)).sum(axis=2)
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))
