"""Convex parts of a solid divided where its material changes, by planes.

The engine of rigid bodies has one friction and one bounce a part. A part whose surface is of
several materials is cut by the plane that parts these best, and so are both halves, as decision
trees are grown (Breiman et al., Classification and Regression Trees, 1984).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from carillon.arrays import Array, Index, Integers
from sound.scenes.convex import hull_of

NEAR = 0.03
"""Distance from a part, over the longest side of the solid, from which the surface is its own: more
than parts reach beyond it."""
MOST_CUTS = 6
"""Most planes that follow one another."""
PURE = 0.02
"""Share of a part's surface that may be of other materials."""
_AXES = np.eye(3)


class _Plane(NamedTuple):
    normal: Array
    offset: float


def parts_of_one(
    parts: Sequence[Array], vertices: Array, which: Integers
) -> tuple[list[Array], list[int]]:
    """Convex parts, as corners (n, 3) [m], that are each of nearly one material, and its number.

    `which` (V,) are the numbers of the materials at the surface's vertices (V, 3) [m].
    """
    found: list[Array] = []
    numbers: list[int] = []
    for part in parts:
        own = _near(part, vertices)
        for piece, number in _divided(part, vertices[own], np.asarray(which)[own], MOST_CUTS):
            found.append(piece)
            numbers.append(number)
    return found, numbers


def _near(part: Array, vertices: Array) -> Index:
    """Vertices of the surface at a part; the nearest one if there is none."""
    from scipy.spatial import ConvexHull

    equations = ConvexHull(part).equations
    outside = (vertices @ equations[:, :3].T + equations[:, 3]).max(axis=1)
    own = np.flatnonzero(outside <= NEAR * float(np.ptp(vertices, axis=0).max()))
    return own if len(own) else np.array([outside.argmin()])


def _divided(part: Array, points: Array, numbers: Integers, cuts: int) -> list[tuple[Array, int]]:
    counts = np.bincount(numbers)
    whole = [(part, int(counts.argmax()))]
    if cuts == 0 or counts.max() >= (1.0 - PURE) * len(numbers):
        return whole
    plane = _best(points, numbers)
    if plane is None:
        return whole
    below = points @ plane.normal <= plane.offset
    pieces = [_piece(part, plane, side) for side in (1.0, -1.0)]
    result = []
    for piece, chosen in zip(pieces, (below, ~below)):
        if piece is None:  # as flat as rounding errors
            return whole
        result += _divided(piece, points[chosen], numbers[chosen], cuts - 1)
    return result


def _best(points: Array, numbers: Integers) -> _Plane | None:
    """The plane by which most of the points (p, 3) are told apart by their numbers; None if none
    does.
    """
    kinds, own = np.unique(numbers, return_inverse=True)
    member = (own.ravel()[:, None] == np.arange(len(kinds))).astype(float)
    best, found = _mixed(member.sum(axis=0)[None])[0] * (1.0 - 1e-9), None
    for normal in (*_AXES, *_discriminants(points, member)):
        heights = points @ normal
        order = np.argsort(heights, kind="stable")
        sums = np.cumsum(member[order], axis=0)
        sorted_ = heights[order]
        ends = np.flatnonzero(np.diff(sorted_) > 1e-9 * max(float(np.ptp(heights)), 1e-300))
        if not len(ends):
            continue
        mixed = _mixed(sums[ends]) + _mixed(sums[-1] - sums[ends])
        least = int(mixed.argmin())
        if mixed[least] < best:
            at = ends[least]
            best, found = mixed[least], _Plane(normal, 0.5 * float(sorted_[at] + sorted_[at + 1]))
    return found


def _mixed(counts: Array) -> Array:
    """Gini's impurity (n,) times the number of points, from counts (n, k) of each kind."""
    total = counts.sum(axis=1)
    return np.asarray(total - (counts**2).sum(axis=1) / np.maximum(total, 1.0))


def _discriminants(points: Array, member: Array) -> list[Array]:
    """Normals of the planes by which each kind is told from all others best (Fisher 1936)."""
    normals = []
    for column in member.T:
        inside, outside = points[column > 0.0], points[column == 0.0]
        if min(len(inside), len(outside)) < 4:
            continue
        spread = np.cov(inside.T) + np.cov(outside.T)
        spread += 1e-6 * np.trace(spread) * np.eye(3)
        normal = np.linalg.solve(spread, inside.mean(axis=0) - outside.mean(axis=0))
        normals.append(normal / max(float(np.linalg.norm(normal)), 1e-300))
    return normals


def _piece(part: Array, plane: _Plane, side: float) -> Array | None:
    """Corners of what of a convex part is below (1) or above (-1) a plane."""
    from scipy.spatial import QhullError

    heights = side * (part @ plane.normal - plane.offset)
    low, high = np.flatnonzero(heights <= 0.0), np.flatnonzero(heights > 0.0)
    if not len(low):
        return None
    share = heights[low][:, None] / (heights[low][:, None] - heights[high])
    crossed = part[low][:, None] + share[:, :, None] * (part[high] - part[low][:, None])
    try:
        return hull_of(np.concatenate([part[low], crossed.reshape(-1, 3)]))
    except QhullError:
        return None
