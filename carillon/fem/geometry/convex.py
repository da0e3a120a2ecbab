"""Lines through a union of convex bodies: the pieces of each line that lie in any of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index

NOTHING, CYLINDER, BALL = 0, 1, 2
"""Round surface that bounds a body besides its planes."""
TOUCHING = 1e-9
"""Gap between two pieces that are one, and distance by which planes between bodies are moved apart,
so that none slips between two that share one; in units of the lattice."""
PARALLEL = 1e-13
"""Cosine between a line and a plane's normal, or square of the sine between it and an axis, up to
which they are parallel."""


@dataclass(frozen=True)
class ConvexBodies:
    """Convex bodies, each of which some planes and a ball or a cylinder bound.

    Corners and planes of body i are those from ``start[i]`` to ``start[i + 1]``.
    """

    corner_start: Index
    corners: Array
    """(b + 1,), (c, 3): points whose convex hull holds the body."""
    plane_start: Index
    planes: Array
    """(b + 1,), (p, 4): what is inside has n·x <= d, of rows (n, d) with unit normals n."""
    is_between: Flags
    """(p,) planes beyond which other bodies go on."""
    kind: NDArray[np.int8]
    """(b,) `NOTHING`, `CYLINDER` or `BALL`."""
    centre: Array
    along: Array
    """(b, 3) a point of its axis, or its centre; unit vector along the axis."""
    radius: float
    """Of all balls and cylinders."""

    def __len__(self) -> int:
        return len(self.kind)

    @classmethod
    def together(cls, several: Sequence[ConvexBodies]) -> ConvexBodies:
        """All of several, which have one radius."""

        def joined(name: str) -> Any:
            return np.concatenate([getattr(each, name) for each in several])

        def starts(name: str) -> Index:
            lengths = [np.diff(getattr(each, name)) for each in several]
            return np.append(0, np.cumsum(np.concatenate(lengths))).astype(np.int64)

        return cls(
            starts("corner_start"),
            joined("corners"),
            starts("plane_start"),
            joined("planes"),
            joined("is_between"),
            joined("kind"),
            joined("centre"),
            joined("along"),
            several[0].radius,
        )

    def moved(self, origin: Array, edge: float) -> ConvexBodies:
        """The same in lattice units, with planes between bodies moved apart.

        `origin` (3,) and `edge`: of a lattice, in the units of the bodies.
        """
        planes = self.planes.copy()
        planes[:, 3] = (planes[:, 3] - planes[:, :3] @ origin) / edge
        planes[self.is_between, 3] += TOUCHING
        return replace(
            self,
            corners=(self.corners - origin) / edge,
            planes=planes,
            centre=(self.centre - origin) / edge,
            radius=self.radius / edge,
        )


def line_pieces(
    bodies: ConvexBodies, rows: Array, columns: Array, axis: int, chosen: Flags
) -> tuple[Index, Array, Array]:
    """Pieces of lines along an axis that lie in any of the bodies.

    Parameters
    ----------
    bodies
        In lattice units.
    rows, columns
        Ascending coordinates of the lines along axis + 1 and axis + 2, modulo 3: line (i, j) has
        the number ``i * len(columns) + j``.
    chosen : (r, c)
        Which lines are asked for, as blocks of ``len(rows) / r`` by ``len(columns) / c`` of them.

    Returns
    -------
    start : (lines + 1,)
        Range of each line's pieces.
    low, high : (k,)
        Their ends, ascending on each line; none touch.
    """
    turned = [(axis + 1) % 3, (axis + 2) % 3, axis]
    corners = np.ascontiguousarray(bodies.corners[:, turned])
    low = np.minimum.reduceat(corners, bodies.corner_start[:-1]) if len(bodies) else corners
    high = np.maximum.reduceat(corners, bodies.corner_start[:-1]) if len(bodies) else corners
    first = np.searchsorted(rows, low[:, 0] - TOUCHING)
    last = np.searchsorted(rows, high[:, 0] + TOUCHING, side="right")
    order = np.argsort(first, kind="stable")
    met = order[first[order] < last[order]]
    return _sweep(  # type: ignore[no-any-return]
        met,
        first,
        last,
        bodies.corner_start,
        corners,
        bodies.plane_start,
        np.ascontiguousarray(bodies.planes[:, [*turned, 3]]),
        bodies.kind,
        np.ascontiguousarray(bodies.centre[:, turned]),
        np.ascontiguousarray(bodies.along[:, turned]),
        bodies.radius,
        rows,
        columns,
        np.ascontiguousarray(chosen),
    )


@numba.njit(cache=True, nogil=True)
def _sweep(  # type: ignore[no-untyped-def]
    met,
    first,
    last,
    corner_start,
    corners,
    plane_start,
    planes,
    kind,
    centre,
    along,
    radius,
    rows,
    columns,
    chosen,
):
    """Pieces of the lines of one row after the other, with the bodies that reach it."""
    start = np.zeros(len(rows) * len(columns) + 1, dtype=np.int64)
    low, high, count = np.empty(1024), np.empty(1024), 0
    hits, column_of, number = np.empty((2, 1024)), np.empty(1024, dtype=np.int64), 0
    active, size, following = np.empty(len(met), dtype=np.int64), 0, 0
    per_row = max(len(rows) // max(chosen.shape[0], 1), 1)
    per_column = max(len(columns) // max(chosen.shape[1], 1), 1)
    for row in range(len(rows)):
        while following < len(met) and first[met[following]] == row:
            active[size] = met[following]
            size += 1
            following += 1
        number, left = 0, 0
        asked = chosen[row // per_row]
        is_asked = asked.any()
        for place in range(size):
            body = active[place]
            if last[body] <= row:
                continue
            active[left] = body
            left += 1
            if not is_asked:
                continue
            low_y, high_y = _extent(corners, corner_start[body], corner_start[body + 1], rows[row])
            for column in range(np.searchsorted(columns, low_y - TOUCHING), len(columns)):
                if columns[column] > high_y + TOUCHING:
                    break
                if not asked[column // per_column]:
                    continue
                begin, end = _between(
                    planes, plane_start[body], plane_start[body + 1], rows[row], columns[column]
                )
                if begin < end and kind[body] != NOTHING:
                    begin, end = _in_round(
                        kind[body] == CYLINDER,
                        centre,
                        along,
                        body,
                        radius,
                        rows[row],
                        columns[column],
                        begin,
                        end,
                    )
                if end <= begin:
                    continue
                if number == len(column_of):
                    hits = np.concatenate((hits, np.empty_like(hits)), axis=1)
                    column_of = np.concatenate((column_of, np.empty_like(column_of)))
                hits[0, number], hits[1, number], column_of[number] = begin, end, column
                number += 1
        size = left
        begins, ends, first_hit = _by_column(
            hits[0, :number], hits[1, :number], column_of[:number], len(columns)
        )
        line = row * len(columns)
        for column in range(len(columns)):
            before = count
            for hit in range(first_hit[column], first_hit[column + 1]):
                if count > before and begins[hit] <= high[count - 1] + TOUCHING:
                    high[count - 1] = max(high[count - 1], ends[hit])
                    continue
                if count == len(low):
                    low = np.concatenate((low, np.empty_like(low)))
                    high = np.concatenate((high, np.empty_like(high)))
                low[count], high[count] = begins[hit], ends[hit]
                count += 1
            start[line + column + 1] = count
    return start, low[:count].copy(), high[:count].copy()


@numba.njit(cache=True, nogil=True)
def _by_column(begins, ends, columns, count):  # type: ignore[no-untyped-def]
    """Begins and ends of hits by their columns, in each by where they begin; first of each."""
    first = np.zeros(count + 1, dtype=np.int64)
    for column in columns:
        first[column + 1] += 1
    first = np.cumsum(first)
    last = first[:-1].copy()
    low, high = np.empty_like(begins), np.empty_like(begins)
    for hit in range(len(columns)):
        column, begin, end = columns[hit], begins[hit], ends[hit]
        place = last[column]
        last[column] += 1
        while place > first[column] and low[place - 1] > begin:
            low[place], high[place] = low[place - 1], high[place - 1]
            place -= 1
        low[place], high[place] = begin, end
    return low, high, first


@numba.njit(cache=True, nogil=True)
def _extent(corners, begin, end, x):  # type: ignore[no-untyped-def]
    """Lowest and highest y at x of the convex hull of some corners (c, 3), seen along z."""
    low, high = np.inf, -np.inf
    for i in range(begin, end):
        px, py = corners[i, 0], corners[i, 1]
        if abs(px - x) <= TOUCHING:
            low, high = min(low, py), max(high, py)
        if px > x:
            continue
        for j in range(begin, end):
            qx = corners[j, 0]
            if qx > x:
                y = py + (corners[j, 1] - py) * ((x - px) / (qx - px))
                low, high = min(low, y), max(high, y)
    return low, high


@numba.njit(cache=True, nogil=True)
def _between(planes, first, last, x, y):  # type: ignore[no-untyped-def]
    """Begin and end of the piece of the line (x, y) behind some planes; not ascending if none."""
    low, high = -np.inf, np.inf
    for number in range(first, last):
        steep = planes[number, 2]
        rest = planes[number, 3] - planes[number, 0] * x - planes[number, 1] * y
        if abs(steep) < PARALLEL:
            if rest < 0.0:
                return 0.0, 0.0
        elif steep > 0.0:
            high = min(high, rest / steep)
        else:
            low = max(low, rest / steep)
    return low, high


@numba.njit(cache=True, nogil=True)
def _in_round(is_cylinder, centre, along, body, radius, x, y, low, high):  # type: ignore[no-untyped-def]
    """What of the piece from `low` to `high` of the line (x, y) is in a ball or a cylinder."""
    px, py = x - centre[body, 0], y - centre[body, 1]
    forward, steep = 0.0, 0.0
    if is_cylinder:
        forward, steep = px * along[body, 0] + py * along[body, 1], along[body, 2]
    # Of z from the centre on: square z^2 + 2 middle z + rest <= 0.
    square, middle = 1.0 - steep * steep, -forward * steep
    rest = px * px + py * py - forward * forward - radius * radius
    if square < PARALLEL:
        return (low, high) if rest <= 0.0 else (0.0, 0.0)
    root = middle * middle - square * rest
    if root <= 0.0:
        return 0.0, 0.0
    root = np.sqrt(root)
    z = centre[body, 2]
    return max(low, z + (-middle - root) / square), min(high, z + (-middle + root) / square)
