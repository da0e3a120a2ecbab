"""Bodies of a surface that touch along edges or in points alone, where nothing holds them together.

Voxels and finite cells that both have a share in would join them, stiffly, wherever the lattice
happens to lie.
"""

from itertools import combinations

import numpy as np

from carillon.arrays import Array, Index, Surface
from carillon.command_line.logs import warn_once
from carillon.errors import UserError
from carillon.fem.geometry.crossings import line_crossings
from carillon.fem.geometry.facets import (
    ClosedPart,
    Facets,
    closed_parts,
    connected,
    winding_numbers,
)
from carillon.fem.geometry.pinches import MOST_EDGES, pinches

TOUCHING = 1e-7
"""Distance, over the longest side, of a corner from another body up to which the two touch."""
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
MOST_PARTS = 100
"""Parts beyond which no contacts are sought."""


def one_body(surface: Surface, components: str, name: str) -> Surface:
    """The surface, without bodies that touch its largest one along edges or in points alone.

    A body that touches itself along edges is warned of. Raises UserError if there are such bodies
    and `components` is ``"error"``.
    """
    facets = Facets.of_surface(np.asarray(surface.vertices), np.asarray(surface.faces), sheets=True)
    kept = _without_others(surface, facets, components, name)
    if kept is not surface or facets.sheet.any():
        facets = Facets.of_surface(np.asarray(kept.vertices), np.asarray(kept.faces))
    _say_pinched(kept, facets, name)
    return kept


def _say_pinched(surface: Surface, facets: Facets, name: str) -> None:
    edges = pinches(facets) if len(facets) else np.empty((0, 2, 3))
    if not len(edges):
        return
    low = surface.vertices[surface.faces].min(axis=(0, 1))
    at = ", ".join(f"{x:.4g}" for x in low + surface.extents.max() * edges[0].mean(axis=0))
    many = f"{len(edges):,} edges{' or more' if len(edges) == MOST_EDGES else ''}, the longest"
    along = "an edge" if len(edges) == 1 else many
    warn_once(
        f"mesh {name!r} touches itself along {along} at ({at}) m; the model joins the two sides "
        "there, so frequencies are too high if little else does: let them overlap or move them "
        "apart"
    )


def _without_others(surface: Surface, facets: Facets, components: str, name: str) -> Surface:
    parts = closed_parts(facets) if len(facets) and facets.patches.any() else []
    outer = [part for part in parts if part.volume > 0.0]
    if not 2 <= len(outer) <= MOST_PARTS:
        return surface
    body = _bodies(facets, outer)
    touching = [
        (body[i], body[j])
        for i, j in combinations(range(len(outer)), 2)
        if body[i] != body[j] and _touch(facets, outer[i], outer[j])
    ]
    if not touching:
        return surface
    if components == "error":
        raise UserError(
            f"mesh {name!r} falls into {body.max() + 1} pieces that touch along an edge or in a "
            "point at most, where nothing holds them together; let them overlap, or keep the "
            "largest alone (--components largest)"
        )
    volumes = np.bincount(body, [part.volume for part in outer])
    largest = int(volumes.argmax())
    loose = [part for part, own in zip(outer, body) if own != largest]
    loose += [part for part in parts if part.volume < 0.0 and _lies_in(facets, part, loose)]
    dropped = np.zeros(len(facets), dtype=bool)
    dropped[np.concatenate([part.triangles for part in loose])] = True
    kept = surface.copy()
    kept.update_faces(~(dropped[facets.of_face] & (facets.of_face >= 0)))
    return kept


def _bodies(facets: Facets, parts: list[ClosedPart]) -> Index:
    """Body of each part: those that overlap, or share an area, are one."""
    joined: list[tuple[int, int]] = []
    body = np.arange(len(parts))
    for i, j in combinations(range(len(parts)), 2):
        if body[i] != body[j] and _joined(facets, parts[i], parts[j]):
            joined.append((i, j))
            body = connected(len(parts), *np.array(joined).T)
    return body


def _common_box(one: ClosedPart, other: ClosedPart) -> tuple[Array, Array]:
    return np.maximum(one.low, other.low), np.minimum(one.high, other.high)


def _joined(facets: Facets, one: ClosedPart, other: ClosedPart) -> bool:
    low, high = _common_box(one, other)
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
    gap = np.maximum(starts[0][pairs], starts[1][mate]) - np.minimum(ends[0][pairs], ends[1][mate])
    return bool((gap <= MEETING).any())


def _holds_corners(
    facets: Facets, one: ClosedPart, other: ClosedPart, low: Array, high: Array
) -> bool:
    corners = facets.vertices[np.unique(facets.triangles[one.triangles])]
    corners = corners[((corners >= low) & (corners <= high)).all(axis=1)]
    corners = corners[:: -(-len(corners) // SAMPLE) or 1]
    if not len(corners):
        return False
    corners = corners[np.abs(winding_numbers(facets, other.triangles, corners)) > DEEP]
    return bool((_distances(facets, other, corners) > MEETING).any())


def _touch(facets: Facets, one: ClosedPart, other: ClosedPart) -> bool:
    low, high = _common_box(one, other)
    if (high - low < -TOUCHING).any():
        return False
    for own, others in ((one, other), (other, one)):
        corners = facets.vertices[np.unique(facets.triangles[own.triangles])]
        near = ((corners >= low - TOUCHING) & (corners <= high + TOUCHING)).all(axis=1)
        if (_distances(facets, others, corners[near]) <= TOUCHING).any():
            return True
    return False


def _distances(facets: Facets, part: ClosedPart, points: Array) -> Array:
    import igl

    if not len(points):
        return np.empty(0)
    arrays = (points, facets.vertices, facets.triangles[part.triangles])
    squares = igl.point_mesh_squared_distance(*map(np.ascontiguousarray, arrays))[0]
    return np.sqrt(np.atleast_1d(squares))


def _lies_in(facets: Facets, cavity: ClosedPart, parts: list[ClosedPart]) -> bool:
    corner = facets.vertices[facets.triangles[cavity.triangles[:1]]].mean(axis=1)
    numbers = [winding_numbers(facets, part.triangles, corner)[0] for part in parts]
    return any(abs(number) > 0.5 for number in numbers)
