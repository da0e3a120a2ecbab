"""The solid about a surface as a union of convex bodies, to some heights on its two sides.

Over each triangle there is a prism. Where triangles turn away from each other at an edge, a sector
of a cylinder fills the gap between their prisms, and at a vertex the part of a ball that is nearer
to it than to any edge: together they are all points within the distance (Minkowski sum with a
ball). Rims are cut flat: nothing reaches beyond the prisms there.
"""

from __future__ import annotations

import numpy as np

from carillon.arrays import Array, Flags
from carillon.fem.geometry.convex import CYLINDER, NOTHING, ConvexBodies
from carillon.fem.geometry.sheets import Gaps, Sheets
from carillon.fem.geometry.vertex_cones import cones_of_vertices

STRAIGHT = 1e-7
"""Angle [rad] between triangles up to which no sector lies between them."""
WIDEST = 0.6 * np.pi
"""Angle of a sector up to which two tangents meet near enough to make its corners."""
ACUTE = 0.5 * np.pi
"""Angle between triangles below which a prism on one side alone would reach through the other."""


def offset_bodies(
    sheets: Sheets, low: float, high: float, is_mitred: bool
) -> tuple[ConvexBodies, Array]:
    """Bodies from `low` <= 0 to `high` >= 0 along the normals, and corners (2, 3) of the box about.

    Either the two heights are opposite, or one is zero; triangles are then turned alike. If
    `is_mitred`, prisms on one side end halfway to their neighbours in sharp inner edges, so that
    they do not reach through them.
    """
    radius = max(-low, high)
    side = 0 if low < 0.0 < high else (1 if high > 0.0 else -1)
    across, is_between = _sides(sheets, side if is_mitred else 0)
    found = [
        _prisms(sheets, (low, high), across, is_between),
        _sectors(sheets, radius, side),
        cones_of_vertices(sheets, radius, side),
    ]
    bodies = [each for each, _ in found if len(each)]
    ends = np.array([each for _, each in found])
    box = np.stack([ends[:, 0].min(axis=0), ends[:, 1].max(axis=0)])
    return ConvexBodies.together(bodies), box


def _prisms(
    sheets: Sheets, heights: tuple[float, float], across: Array, is_between: Flags
) -> tuple[ConvexBodies, Array]:
    """Prisms over the triangles, whose sides have normals (t, 3, 3)."""
    (low, high), count = heights, len(sheets)
    corners, normals = sheets.corners, sheets.normals
    hull = np.concatenate([corners + z * normals[:, None] for z in (low, high)], axis=1)
    planes = np.empty((count, 5, 4))
    planes[:, :3, :3] = -across
    planes[:, :3, 3] = -(across * corners).sum(axis=2)
    height = (normals * corners[:, 0]).sum(axis=1)
    planes[:, 3, :3], planes[:, 3, 3] = normals, height + high
    planes[:, 4, :3], planes[:, 4, 3] = -normals, -height - low
    between = np.zeros((count, 5), dtype=bool)
    between[:, :3] = is_between
    bodies = ConvexBodies(
        6 * np.arange(count + 1),
        hull.reshape(-1, 3),
        5 * np.arange(count + 1),
        planes.reshape(-1, 4),
        between.ravel(),
        np.full(count, NOTHING, dtype=np.int8),
        np.zeros((count, 3)),
        np.zeros((count, 3)),
        max(-low, high),
    )
    return bodies, np.array([hull.min(axis=(0, 1)), hull.max(axis=(0, 1))])


def _sides(sheets: Sheets, side: int) -> tuple[Array, Flags]:
    """Inward normals (t, 3, 3) of the prisms' sides, and whether others go on there (t, 3).

    They are across the triangle, or where two meet at an acute angle on the one side that counts,
    halfway between them.
    """
    gaps, across = sheets.gaps, sheets.inward.copy()
    is_between = np.ones(len(across), dtype=bool)
    is_between[gaps.halves[gaps.is_rim, 0]] = False
    if side:
        acute = ~gaps.is_rim & (gaps.angle < ACUTE) & _on_side(gaps, side)
        half = 0.5 * gaps.angle[acute, None]
        for number in (0, 1):
            own = gaps.halves[acute, number]
            outward = sheets.outward(gaps.side[acute, number])
            across[own] = np.sin(half) * sheets.inward[own] - np.cos(half) * outward
    return across.reshape(-1, 3, 3), is_between.reshape(-1, 3)


def _on_side(gaps: Gaps, side: int) -> Flags:
    """Gaps (g,) between two sides that are both on one side of their triangles: 1 or -1."""
    return np.asarray((gaps.side % 2 == (side < 0)).all(axis=1))


def _sectors(sheets: Sheets, radius: float, side: int) -> tuple[ConvexBodies, Array]:
    gaps = sheets.gaps
    angle = gaps.angle - np.pi
    wanted = (angle > STRAIGHT) & ~gaps.is_rim
    if side:
        wanted &= _on_side(gaps, side)
    else:
        wanted |= sheets.joined_rims
    own = np.flatnonzero(wanted)
    count, angle = len(own), angle[own]
    ends = sheets.vertices[gaps.ends[own]]
    along = ends[:, 1] - ends[:, 0]
    along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    first, second = (sheets.outward(gaps.side[own, number]) for number in (0, 1))
    planes = np.empty((count, 4, 4))
    planes[:, 0, :3], planes[:, 1, :3] = -np.cross(along, first), np.cross(along, second)
    planes[:, 2, :3], planes[:, 3, :3] = -along, along
    planes[:, :3, 3] = (planes[:, :3, :3] * ends[:, None, 0]).sum(axis=2)
    planes[:, 3, 3] = (along * ends[:, 1]).sum(axis=1)
    between = np.tile([True, True, False, False], (count, 1))
    middle = np.cross(along, first) * np.sin(0.5 * angle)[:, None]
    middle += first * np.cos(0.5 * angle)[:, None]
    sideways = np.cross(along, middle)
    meeting = middle / np.cos(0.5 * np.minimum(angle, WIDEST))[:, None]
    narrow = np.stack([first, second, meeting, np.zeros_like(first)])
    wide = np.stack([middle + sideways, middle - sideways, sideways, -sideways])
    reach = np.where((angle > WIDEST)[:, None], wide, narrow).transpose(1, 0, 2)
    hull = ends[:, None] + radius * reach[:, :, None]
    bodies = ConvexBodies(
        8 * np.arange(count + 1),
        hull.reshape(-1, 3),
        4 * np.arange(count + 1),
        planes.reshape(-1, 4),
        between.ravel(),
        np.full(count, CYLINDER, dtype=np.int8),
        ends[:, 0],
        along,
        radius,
    )
    return bodies, _box_of_sectors(ends, along, first, second, radius)


def _box_of_sectors(ends: Array, along: Array, first: Array, second: Array, radius: float) -> Array:
    """Lowest and highest corner (2, 3) of the box about sectors."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    if not len(ends):
        return np.stack([low, high])
    for axis in range(3):
        straight = np.eye(3)[axis] - along[:, axis, None] * along
        length = np.linalg.norm(straight, axis=1)
        unit = straight / np.maximum(length, 1e-300)[:, None]
        for way in (-1.0, 1.0):
            within = (np.cross(along, first) * unit).sum(axis=1) * way >= 0.0
            within &= (np.cross(second, along) * unit).sum(axis=1) * way >= 0.0
            reach = np.maximum(way * first[:, axis], way * second[:, axis])
            reach = np.where(within, length, reach)
            place = (way * ends[:, :, axis]).max(axis=1) + radius * np.maximum(reach, 0.0)
            if way > 0.0:
                high[axis] = place.max()
            else:
                low[axis] = -place.max()
    return np.stack([low, high])
