"""Edges along which a solid touches itself.

Around such an edge of the mesh, solid and void alternate more than once. Voxels and finite cells
that both sides have a share in join them there.
"""

import numpy as np

from carillon.arrays import Array, Index
from carillon.fem.geometry.facets import Facets, connected, winding_numbers

COINCIDENT = 1e-6
"""Angle [rad] around an edge within which two triangles lie on each other."""
BESIDE = 1e-4
"""Distance of points beside an edge, over its length."""
INSIDE = 0.5
"""Winding number of points in the solid."""
MOST_EDGES = 1000
"""Edges that are looked at, the longest ones."""


def pinches(facets: Facets) -> Array:
    """Ends (k, 2, 3) of edges along which a solid touches itself, the longest first.

    `facets`: the whole surface as one sheet, its faces turned alike. Triangles that are there both
    ways are walls inside the solid and do not count.
    """
    there = facets.of_face >= 0
    times = np.bincount(facets.of_face[there], facets.along[there], minlength=len(facets))
    sign = np.sign(times).astype(np.int64)
    own = np.flatnonzero(sign)
    pairs = np.stack([facets.triangles[own], np.roll(facets.triangles[own], -1, axis=1)], axis=2)
    pairs = pairs.reshape(-1, 2)
    low, high = pairs.min(axis=1), pairs.max(axis=1)
    _, first, edge, counts = np.unique(
        low * len(facets.vertices) + high,
        return_index=True,
        return_inverse=True,
        return_counts=True,
    )
    ends = facets.vertices[np.stack([low[first], high[first]], axis=1)]
    crowded = np.flatnonzero(counts > 2)
    length = np.linalg.norm(ends[crowded, 1] - ends[crowded, 0], axis=1)
    chosen = crowded[np.argsort(-length, kind="stable")[:MOST_EDGES]]
    if not len(chosen):
        return np.empty((0, 2, 3))
    number = np.full(len(ends), -1)
    number[chosen] = np.arange(len(chosen))
    side = np.flatnonzero(number[edge] >= 0)
    third = facets.triangles[own[side // 3], (side + 2) % 3]
    step = np.where(pairs[side, 0] == low[side], -1, 1) * sign[own[side // 3]]
    chosen_ends, own_edge = ends[chosen], number[edge[side]]
    order, angle, probe = _round_edges(chosen_ends, own_edge, facets.vertices[third])
    solids = _solids(facets, sign, own_edge[order], angle, step[order], probe)
    return np.asarray(chosen_ends[solids > 1])


def _round_edges(ends: Array, edge: Index, third: Array) -> tuple[Index, Array, Array]:
    """Order (s,) of triangles round their edges, and their angles (s,) [rad] in it.

    Also two arms (e, 2, 3) across each edge, as long as a point beside it is away: at the angle
    zero and at a right one.
    """
    along = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(along, axis=1)[:, None]
    along = along / length
    across = np.cross(along, np.eye(3)[np.abs(along).argmin(axis=1)])
    across /= np.linalg.norm(across, axis=1)[:, None]
    arms = np.stack([across, np.cross(along, across)], axis=1)
    x, y = np.einsum("sd,sad->as", third - ends[edge, 0], arms[edge])
    angle = np.arctan2(y, x)
    order = np.lexsort((angle, edge))
    middle = ends.mean(axis=1)
    return (
        order,
        angle[order],
        np.stack([middle, *np.moveaxis(BESIDE * length[:, None] * arms, 1, 0)], axis=1),
    )


def _solids(
    facets: Facets, sign: Index, edge: Index, angle: Array, step: Index, probe: Array
) -> Index:
    """How many solids (e,) round each edge have no sector of it in common.

    Triangles are in order: `edge` (s,), `angle` (s,) and `step` (s,), by which the winding number
    rises. `probe` (e, 3, 3) is each edge's middle, and arms at the angle zero and at a right one.
    """
    count = len(edge)
    first = np.flatnonzero(np.diff(edge, prepend=-1))
    last = np.append(first[1:], count) - 1
    after = np.arange(1, count + 1)
    after[last] = first
    gap = angle[after] - angle
    gap[last] += 2.0 * np.pi
    # A point in the widest sector tells its winding number; each triangle steps by one.
    widest = np.lexsort((-gap, edge))[first]
    turn = angle[widest] + 0.5 * gap[widest]
    weights = np.stack([np.ones(len(turn)), np.cos(turn), np.sin(turn)], axis=1)
    points = np.einsum("ew,ewd->ed", weights, probe)
    total = np.cumsum(step)
    number = winding_numbers(facets, np.arange(len(facets)), points, sign) - total[widest]
    solid = np.abs(number[edge] + total) > INSIDE
    linked = solid | (gap < COINCIDENT)
    run = connected(count, np.flatnonzero(linked), after[linked])
    runs = np.flatnonzero(solid)
    runs = runs[np.unique(run[runs], return_index=True)[1]]
    return np.bincount(edge[runs], minlength=len(probe))
