"""Faces of a surface turned alike: all that share edges, and all parts, but not cavities.

A face that is turned against its neighbours, or a part that is inside out, takes away from the
winding number what it should add: the solid gets holes and hollows that nobody sees.
"""

import numpy as np

from carillon.arrays import Array, Flags, Index
from carillon.command_line.logs import warn_once
from carillon.errors import UserError
from carillon.fem.geometry.facets import (
    Facets,
    connected,
    parts_of,
    signed_volumes,
    winding_numbers,
)

INSIDE = 0.5
"""Winding number of another part about a point from which on the point is in it."""
POKING = 0.02
"""Share of a closed part's area outside the others from which on it is no cavity."""
MOSTLY = 0.5
"""Share of an open part's area outside the others from which on it is no cavity."""
CERTAIN = 0.15
"""Mean winding number of an open part on itself, half of one if closed, that tells its inside."""
BESIDE = 1e-4
"""Distance of points beside a triangle, over its size."""
TURNS = 4
"""Parts of a surface, in the order of its triangles, between which points inside are looked for."""
SAMPLE = 100
"""Triangles of a part that are looked at."""
LEAST = 1e-4
"""Share of the surface's area below which a part is a crumb."""


def turned_alike(vertices: Array, faces: Index, name: str) -> Index | None:
    """Faces (f, 3) of a solid's surface, of which those that are turned the wrong way are turned.

    Two triangles that alone share an edge pass it in opposite ways; parts that are inside out are
    turned as the others are, unless they are cavities of them. Of faces that are there both ways
    one stays. Everything is as it was, None, if no face has to be turned. Raises UserError if all
    faces of the surface, or of a closed part, are there both ways, or faces cannot be turned alike.
    `vertices` (v, 3): in any unit; those at one place are one.
    """
    facets = Facets.of_surface(vertices, faces)
    if not len(facets):
        return None
    _require_one_side(facets, _both_ways(facets), name)
    facets = Facets.of_surface(vertices, faces, sheets=True)
    both, sign = _both_ways(facets), np.ones(len(facets), dtype=np.int64)
    patch = facets.patches
    doubled = np.zeros(len(facets), dtype=bool)
    if both.any() or not facets.links[2].all():
        sign = _within_patches(facets, patch, both, name)
        doubled = both & ~_only(both, patch)[patch]
        _say_turned(facets, sign, both, name)
    cancelled = both & ~doubled
    sign[cancelled] = 0
    balance = facets.unbalanced(sign)
    if (sign < 0).any() and balance.any() and not (facets.edges[2] & 1).any():
        raise UserError(_refusal(name))
    part, closed = parts_of(facets, sign, balance)
    wrong = _inside_out(facets, part, closed, sign)
    if wrong.any():
        warn_once(
            f"{name}: {np.count_nonzero(wrong)} of {part.max() + 1} parts were inside out and are "
            "turned; see that no hollow is filled by that"
        )
        sign[wrong[part]] *= -1
    if not (sign < 0).any() and not doubled.any():
        return None
    return _faces(faces, facets, sign, doubled)


def _both_ways(facets: Facets) -> Flags:
    """Triangles (t,) that are there as often one way as the other."""
    there = facets.of_face >= 0
    total = np.bincount(facets.of_face[there], facets.along[there], minlength=len(facets))
    return np.asarray(total == 0)


def _only(flags: Flags, patch: Index) -> Flags:
    """Patches (p,) all of whose triangles have the flag."""
    return np.asarray(np.bincount(patch, ~flags) == 0)


def _require_one_side(facets: Facets, both: Flags, name: str) -> None:
    if not both.any():
        return
    edge, _, counts = facets.edges
    patch = facets.patches
    open_patch = np.bincount(patch, (counts[edge] != 2).reshape(-1, 3).any(axis=1)) > 0
    if both.all() or (_only(both, patch) & ~open_patch).any():
        of = "the surface" if both.all() else "a part of it"
        raise UserError(
            f"{name}: every face of {of} is there both ways, so that it encloses nothing; keep one "
            "of each two faces, or give its walls a thickness"
        )


def _within_patches(facets: Facets, patch: Index, both: Flags, name: str) -> Index:
    """Signs (t,) that turn the triangles of each patch alike, as most of its area is turned."""
    count = len(facets)
    left, right, alike = facets.links
    # Every triangle as it is, and turned: which of the two go with which of a neighbour's.
    turned_right = np.where(alike, right, right + count)
    label = connected(
        2 * count,
        np.concatenate([left, left + count]),
        np.concatenate([turned_right, (turned_right + count) % (2 * count)]),
    )
    first, second = label[:count], label[count:]
    if facets.areas[first == second].sum() > LEAST * facets.areas.sum():
        raise UserError(_refusal(name))
    kind = first <= second
    area = np.where(both, 0.0, facets.areas)
    more = np.bincount(patch, np.where(kind, area, -area)) >= 0.0
    return np.where((kind == more[patch]) | (first == second), 1, -1)


def _refusal(name: str) -> str:
    return (
        f"{name}: faces are turned both ways and cannot be turned alike, so that inside and "
        "outside are not told apart; turn all normals outwards and export it again"
    )


def _say_turned(facets: Facets, sign: Index, both: Flags, name: str) -> None:
    turned, double = np.count_nonzero(sign[~both] < 0), np.count_nonzero(both)
    if turned:
        warn_once(
            f"{name}: {turned:,} of {len(facets):,} faces were turned against their neighbours"
        )
    elif double:
        warn_once(f"{name}: {double:,} of {len(facets):,} faces are there both ways")


def _inside_out(facets: Facets, part: Index, closed: Flags, sign: Index) -> Flags:
    """Parts (p,) that are turned against most of the others and are no cavities of them.

    What lies in a part goes with it.
    """
    wrong = np.zeros(len(closed), dtype=bool)
    if len(closed) == 1:
        return wrong
    facing = _facing(facets, part, closed, sign)
    if not ((facing > 0).any() and (facing < 0).any()):
        return wrong
    volumes = np.abs(signed_volumes(facets, part, sign))
    around = _around(facets, part, np.where(facing == 0, 0.0, volumes), sign)
    root = np.where(around < 0, np.arange(len(closed)), around)
    while (root[root] != root).any():
        root = root[root]
    outer = (root == np.arange(len(closed))) & (facing != 0)
    outward = 1 if (facing * volumes)[outer].sum() >= 0.0 else -1
    among = np.flatnonzero((outer & (facing == outward))[part])
    for each in np.flatnonzero(outer & (facing == -outward)):
        own = np.flatnonzero(part == each)
        points, weights = _points(facets, own)
        numbers = outward * winding_numbers(facets, among, points, sign)
        outside = weights[numbers < INSIDE].sum() / weights.sum()
        # Others that overlap it all around may cover its surface, and not what is in it.
        middles = _within(facets, own, points, sign)
        numbers = outward * winding_numbers(facets, among, middles, sign)
        outside = max(outside, np.count_nonzero(numbers < INSIDE) / max(len(middles), 1))
        wrong[each] = outside > (POKING if closed[each] else MOSTLY)
    return np.asarray(wrong[root] & (facing != 0))


def _within(facets: Facets, own: Index, points: Array, sign: Index) -> Array:
    """Points (m, 3) in a part, between those (k, 3) on its surface."""
    far = [np.roll(points, len(points) * turn // TURNS, axis=0) for turn in range(1, TURNS)]
    middles = 0.5 * (np.concatenate(far) + np.tile(points, (TURNS - 1, 1)))
    return middles[np.abs(winding_numbers(facets, own, middles, sign)) > INSIDE]


def _around(facets: Facets, part: Index, volumes: Array, sign: Index) -> Index:
    """Smallest part (p,) that each part lies in, of those with a volume (p,); -1 if in none."""
    corners = facets.vertices[facets.triangles]
    low, high = np.full((len(volumes), 3), np.inf), np.full((len(volumes), 3), -np.inf)
    np.minimum.at(low, part, corners.min(axis=1))
    np.maximum.at(high, part, corners.max(axis=1))
    around = np.full(len(volumes), -1)
    for each in np.flatnonzero(volumes > 0.0):
        holds = (low <= low[each]).all(axis=1) & (high >= high[each]).all(axis=1)
        holds &= volumes > volumes[each]
        for other in np.flatnonzero(holds)[np.argsort(volumes[holds], kind="stable")]:
            points, weights = _points(facets, np.flatnonzero(part == each))
            numbers = winding_numbers(facets, np.flatnonzero(part == other), points, sign)
            if weights[np.abs(numbers) < INSIDE].sum() <= POKING * weights.sum():
                around[each] = other
                break
    return around


def _facing(facets: Facets, part: Index, closed: Flags, sign: Index) -> Index:
    """Whether the normals of parts (p,) point outwards, 1, or inwards, -1; 0 of crumbs, sheets."""
    area = np.bincount(part, facets.areas)
    facing = np.where(closed, np.sign(signed_volumes(facets, part, sign)), 0.0).astype(np.int64)
    facing[area < LEAST * area.sum()] = 0
    for each in np.flatnonzero(~closed & (area >= LEAST * area.sum())):
        own = np.flatnonzero(part == each)
        chosen = own[:: -(-len(own) // SAMPLE)]
        middles = facets.vertices[facets.triangles[chosen]].mean(axis=1)
        # On both sides, so that a triangle has no say in its own middle.
        size = np.sqrt(np.maximum(facets.areas[chosen], np.finfo(float).tiny))
        beside = BESIDE * facets.normals[chosen] / size[:, None]
        points = np.concatenate([middles - beside, middles + beside])
        numbers = winding_numbers(facets, own, points, sign).reshape(2, -1).mean(axis=0)
        mean = np.average(numbers, weights=facets.areas[chosen])
        facing[each] = np.sign(mean) if abs(mean) > CERTAIN else 0
    return facing


def _points(facets: Facets, own: Index) -> tuple[Array, Array]:
    """Points (k, 3) near the corners, the sides' middles and the middles of triangles; weights."""
    chosen = own[:: -(-len(own) // SAMPLE)]
    corners = facets.vertices[facets.triangles[chosen]]
    middle = corners.mean(axis=1, keepdims=True)
    sides = 0.5 * (corners + np.roll(corners, 1, axis=1))
    around = np.concatenate([corners, sides], axis=1)
    points = np.concatenate([middle, middle + 0.98 * (around - middle)], axis=1)
    return points.reshape(-1, 3), np.repeat(facets.areas[chosen], points.shape[1])


def _faces(faces: Index, facets: Facets, sign: Index, doubled: Flags) -> Index:
    """The faces, turned; of doubled triangles the first face alone."""
    there = facets.of_face >= 0
    turns = np.zeros(len(faces), dtype=bool)
    turns[there] = sign[facets.of_face[there]] < 0
    result = np.where(turns[:, None], faces[:, ::-1], faces)
    kept = np.ones(len(faces), dtype=bool)
    kept[there] = ~doubled[facets.of_face[there]] | (facets.along[there] > 0)
    first = np.unique(np.where(there, facets.of_face, -1), return_index=True)
    once = np.zeros(len(faces), dtype=bool)
    once[first[1]] = True
    kept &= once | ~there | ~doubled[np.maximum(facets.of_face, 0)]
    return np.asarray(result[kept])
