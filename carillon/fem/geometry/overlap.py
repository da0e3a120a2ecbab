"""Whether two parts of a surface overlap or share an area, and how far points are from a part."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carillon.fem.geometry.crossings import line_crossings
from carillon.fem.geometry.facets import Facets
from carillon.fem.geometry.parts import ClosedPart, winding_numbers

Array = NDArray[np.float64]

MEETING = 3e-7
"""Gap on a line from one body into another up to which it goes from one into the other."""
LINES = 48
"""Lines across each side of the box that two bodies have in common."""
SHIFT = 0.41421
"""Place of the first line between the edge of the box and the next one, so that none is special."""
DEEP = 0.9
"""Winding number of points inside a body; on its faces and edges it is less."""
SAMPLE = 1000
"""Corners that are looked at for being inside another body."""


def common_box(one: ClosedPart, other: ClosedPart) -> tuple[Array, Array]:
    """Lowest and highest corner (3,) of the box that two parts have in common."""
    return np.maximum(one.low, other.low), np.minimum(one.high, other.high)


def joined(
    facets: Facets, one: ClosedPart, other: ClosedPart, within: tuple[Array, Array] | None = None
) -> bool:
    """Whether two parts overlap or share an area, `within` a box from a corner (3,) to another."""
    low, high = common_box(one, other)
    if within is not None:
        low, high = np.maximum(low, within[0]), np.minimum(high, within[1])
    if (high - low < -MEETING).any() or np.count_nonzero(high - low <= MEETING) > 1:
        return False
    return any(_meet_on_lines(facets, one, other, low, high, axis) for axis in range(3)) or any(
        _holds_corners(facets, *pair, low, high) for pair in ((one, other), (other, one))
    )


def _meet_on_lines(
    facets: Facets, one: ClosedPart, other: ClosedPart, low: Array, high: Array, axis: int
) -> bool:
    """Whether a line along an axis goes from one part into the other, or through both at once."""
    across = [(axis + 1) % 3, (axis + 2) % 3]
    if (high - low)[across].min() <= MEETING:
        return False
    share = (np.arange(LINES) + SHIFT) / LINES
    rows, columns = (low[b] + share * (high[b] - low[b]) for b in across)
    starts, ends, lines = [], [], []
    for part in (one, other):
        triangles = facets.triangles[part.triangles]
        start, place, step = line_crossings(facets.vertices, triangles, rows, columns, axis)
        line = np.repeat(np.arange(len(start) - 1), np.diff(start))
        total = np.cumsum(step.astype(np.int64))
        inside = np.flatnonzero((total[:-1] != 0) & (line[1:] == line[:-1]))
        starts.append(place[inside])
        ends.append(place[inside + 1])
        lines.append(line[inside])
    first, last = (np.searchsorted(lines[1], lines[0], side) for side in ("left", "right"))
    pairs = np.repeat(np.arange(len(first)), last - first)
    offset = np.arange(len(pairs)) - np.repeat(
        np.cumsum(last - first) - (last - first), last - first
    )
    mate = first[pairs] + offset
    start = np.maximum(starts[0][pairs], starts[1][mate])
    end = np.minimum(ends[0][pairs], ends[1][mate])
    there = (end >= low[axis] - MEETING) & (start <= high[axis] + MEETING)
    return bool((there & (start - end <= MEETING)).any())


def _holds_corners(
    facets: Facets, one: ClosedPart, other: ClosedPart, low: Array, high: Array
) -> bool:
    """Whether corners of one part are inside the other."""
    corners = facets.vertices[np.unique(facets.triangles[one.triangles])]
    corners = corners[((corners >= low) & (corners <= high)).all(axis=1)]
    corners = corners[:: -(-len(corners) // SAMPLE) or 1]
    if not len(corners):
        return False
    corners = corners[np.abs(winding_numbers(facets, other.triangles, corners)) > DEEP]
    return bool((distances(facets, other, corners) > MEETING).any())


def distances(facets: Facets, part: ClosedPart, points: Array) -> Array:
    """Distances (k,) of points (k, 3) from the surface of a part."""
    import igl

    if not len(points):
        return np.empty(0)
    arrays = (points, facets.vertices, facets.triangles[part.triangles])
    squares = igl.point_mesh_squared_distance(*map(np.ascontiguousarray, arrays))[0]
    return np.sqrt(np.atleast_1d(squares))
