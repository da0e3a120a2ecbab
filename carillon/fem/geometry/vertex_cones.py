"""Parts of balls about the vertices of a surface, nearer to them than to any edge there."""

from __future__ import annotations

import numpy as np

from carillon.arrays import Array, Flags, Index
from carillon.fem.geometry.convex import BALL, ConvexBodies
from carillon.fem.geometry.sheets import Sheets

LEAST_SPREAD = 1e-4
"""Angle [rad] of a cone about its middle up to which it is left out."""
MOST_EDGES = 24
"""Edges of a vertex whose cone's rays are sought; about others there is a box."""
FROM_BESIDE = 1e-9
"""Cosine of the angle by which a ray may lie outside its cone."""
MOST_RAYS = 7
"""Rays whose ends are corners of a cone; about more of them there is a box."""
WIDE = 0.2
"""Cosine of the angle of a ray with the middle of its cone from which on a box is taken, too."""
AT_ONCE = 3_000_000
"""Products of rays and planes that are looked at together."""
BOX = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


def cones_of_vertices(sheets: Sheets, radius: float, side: int) -> tuple[ConvexBodies, Array]:
    """Balls about vertices, as far as they are nearest to them and not beyond rims; box (2, 3).

    `side`: 1 or -1 for those alone that triangles turn that side to, 0 for all.
    """
    owner, normals, between = _planes(sheets)
    start = np.searchsorted(owner, np.arange(len(sheets.vertices) + 1))
    towards = np.zeros((len(sheets.vertices), 3))
    np.add.at(towards, sheets.triangles, sheets.normals[:, None])
    found = []
    sizes = np.diff(start)
    for size in np.unique(sizes[sizes > 0]):
        group = np.flatnonzero(sizes == size)
        step = max(1, AT_ONCE // int(size) ** 3)
        for begin in range(0, len(group), step):
            few = group[begin : begin + step]
            planes = normals[start[few, None] + np.arange(size)]
            hull, reach, there = _hulls(planes, towards[few], radius, side)
            found.append((few[there], hull[there], reach[there]))
    own, hull, reach = (np.concatenate(each) for each in zip(*found, strict=True))
    centre, lengths = sheets.vertices[own], sizes[own]
    begins = np.append(0, np.cumsum(lengths)).astype(np.int64)
    rows = np.arange(begins[-1]) + np.repeat(start[own] - begins[:-1], lengths)
    heights = (normals[rows] * np.repeat(centre, lengths, axis=0)).sum(axis=1)
    bodies = ConvexBodies(
        8 * np.arange(len(own) + 1),
        (centre[:, None] + hull).reshape(-1, 3),
        begins,
        np.column_stack([normals[rows], heights]),
        between[rows],
        np.full(len(own), BALL, dtype=np.int8),
        centre,
        np.zeros((len(own), 3)),
        radius,
    )
    ends = centre[:, None] + reach
    low, high = ends[:, 0].min(axis=0, initial=np.inf), ends[:, 1].max(axis=0, initial=-np.inf)
    return bodies, np.stack([low, high])


def _planes(sheets: Sheets) -> tuple[Index, Array, Flags]:
    """Vertices (p,), ascending, planes' outward normals (p, 3), whether bodies go on there (p,)."""
    gaps = sheets.gaps
    edges = np.unique(gaps.ends, axis=0)
    along = sheets.vertices[edges[:, 1]] - sheets.vertices[edges[:, 0]]
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    rims = np.flatnonzero(gaps.is_rim & ~sheets.joined_rims)
    beyond = -sheets.inward[gaps.halves[rims, 0]]
    vertex = np.concatenate([edges[:, 0], edges[:, 1], *gaps.ends[rims].T])
    normals = np.concatenate([along, -along, beyond, beyond])
    between = np.repeat([True, False], [2 * len(edges), 2 * len(rims)])
    order = np.argsort(vertex, kind="stable")
    return vertex[order], normals[order], between[order]


def _hulls(planes: Array, towards: Array, radius: float, side: int) -> tuple[Array, Array, Flags]:
    """Corners (v, 8, 3) about cones of planes (v, p, 3), boxes about them (v, 2, 3), which are any.

    All from the vertex. Rays where two planes meet, and all others are kept, are the cone's edges.
    """
    count, size = planes.shape[:2]
    if size > MOST_EDGES:
        hull = np.tile(radius * BOX, (count, 1, 1))
        return hull, _reach(planes, np.zeros((count, 1, 3)), radius), np.ones(count, dtype=bool)
    i, j = np.triu_indices(size, 1)
    rays = np.cross(planes[:, i], planes[:, j])
    length = np.linalg.norm(rays, axis=2, keepdims=True)
    rays = rays / np.maximum(length, 1e-300)
    rays, length = np.concatenate([rays, -rays], axis=1), np.tile(length[:, :, 0], (1, 2))
    outside = np.einsum("vpi,vri->vrp", planes, rays).max(axis=2, initial=-1.0)
    is_ray = (length > FROM_BESIDE) & (outside <= FROM_BESIDE)
    rays = rays * is_ray[:, :, None]
    middle = rays.sum(axis=1)
    size_of_middle = np.linalg.norm(middle, axis=1)
    middle = middle / np.maximum(size_of_middle, 1e-300)[:, None]
    cosine = np.where(is_ray, np.einsum("vi,vri->vr", middle, rays), 1.0).min(axis=1, initial=1.0)
    there = (size_of_middle > 1e-6) & (cosine < np.cos(LEAST_SPREAD))
    if side:
        there &= side * (middle * towards).sum(axis=1) > 0.0
    # The rays end in a plane beyond the ball.
    ends = radius * rays / np.maximum(cosine, WIDE)[:, None, None]
    low, high = ends.min(axis=1, initial=0.0), ends.max(axis=1, initial=0.0)
    low[cosine < WIDE], high[cosine < WIDE] = -radius, radius
    hull = np.where(BOX < 0.0, low[:, None], high[:, None])
    few = np.flatnonzero((is_ray.sum(axis=1) <= MOST_RAYS) & (cosine >= WIDE))
    order = np.argsort(~is_ray[few], axis=1, kind="stable")[:, :MOST_RAYS]
    hull[few] = 0.0
    hull[few, : order.shape[1]] = np.take_along_axis(ends[few], order[:, :, None], axis=1)
    return hull, _reach(planes, radius * rays, radius), there


def _reach(planes: Array, ends: Array, radius: float) -> Array:
    """Boxes (v, 2, 3) about the parts of balls in cones, whose rays end at `ends` (v, r, 3)."""
    low, high = ends.min(axis=1, initial=0.0), ends.max(axis=1, initial=0.0)
    for axis in range(3):
        low[(planes[:, :, axis] >= 0.0).all(axis=1), axis] = -radius
        high[(planes[:, :, axis] <= 0.0).all(axis=1), axis] = radius
    return np.stack([low, high], axis=1)
