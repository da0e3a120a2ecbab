"""Farthest-point sampling: representatives of many points, each as far as can be from all before.

Points lie in boxes of a k-d tree, and a step passes over the boxes that its new representative is
too far from to change anything: the result is that of the plain algorithm, in a fraction of its
time once the representatives are dense.
"""

from typing import NamedTuple

import numba
import numpy as np

from carillon.arrays import Array, Index
from carillon.command_line.progress import track
from carillon.errors import UserError

BOX_POINTS = 128
"""Most points of a box."""

STEPS = 256
"""Representatives between two signs of progress."""


class Cover(NamedTuple):
    """Representatives of n points."""

    chosen: Index
    """(r,) distinct points, in the order they were picked."""
    nearest: Index
    """(n,) number of the representative nearest to each point, the earlier one of equals."""
    radius: Array
    """(r,) largest distance of any point from the first 1, 2, .., r representatives."""


def _boxes(points: Array) -> tuple[Index, Index]:
    """Order (n,) that has the points of a box side by side, and where boxes start and end."""
    order = np.arange(len(points))
    starts, pending = [], [(0, len(points))]
    while pending:
        first, last = pending.pop()
        if last - first <= BOX_POINTS:
            starts.append(first)
            continue
        here = points[order[first:last]]
        axis = int(np.argmax(np.ptp(here, axis=0)))
        middle = (last - first) // 2
        order[first:last] = order[first:last][np.argpartition(here[:, axis], middle)]
        pending += [(first, first + middle), (first + middle, last)]
    return order, np.array([*sorted(starts), len(points)])


@numba.njit(cache=True, nogil=True)
def _pick(
    points: Array,
    bounds: Index,
    low: Array,
    high: Array,
    first: int,
    chosen: Index,
    nearest: Index,
    square: Array,
    farthest: Array,
    radius: Array,
) -> int:
    """Pick representatives number `first` up to the end of `chosen`; return how many there are.

    `square` (n,) has the squared distances from the representatives, `farthest` (boxes,) its
    largest in each box. It ends early when all points are represented exactly.
    """
    axes = points.shape[1]
    for number in range(first, len(chosen)):
        if number > 0:
            widest = np.argmax(farthest)
            if farthest[widest] == 0.0:
                return number
            start = bounds[widest]
            chosen[number] = start + np.argmax(square[start : bounds[widest + 1]])
        new = points[chosen[number]]
        for box in range(len(farthest)):
            gap = 0.0
            for k in range(axes):
                away = max(low[box, k] - new[k], new[k] - high[box, k], 0.0)
                gap += away * away
            if gap >= farthest[box]:
                continue
            largest = 0.0
            for point in range(bounds[box], bounds[box + 1]):
                distance = 0.0
                for k in range(axes):
                    distance += (points[point, k] - new[k]) ** 2
                if distance < square[point]:
                    square[point] = distance
                    nearest[point] = number
                largest = max(largest, square[point])
            farthest[box] = largest
        radius[number] = np.sqrt(farthest.max())
    return len(chosen)


def farthest_points(points: Array, count: int, label: str = "", visible: bool = False) -> Cover:
    """Pick up to `count` representatives of `points` (n, d) by Euclidean distance.

    The first one is the point nearest to the centre of all. There are fewer when so many cover
    every point exactly.

    Raises UserError for fewer than one representative.
    """
    if count < 1:
        raise UserError(f"{count} representatives, expected at least 1")
    order, bounds = _boxes(points)
    moved = np.ascontiguousarray(points[order])
    low = np.minimum.reduceat(moved, bounds[:-1])
    high = np.maximum.reduceat(moved, bounds[:-1])
    chosen = np.zeros(min(count, len(points)), dtype=np.int64)
    chosen[0] = np.argmin(((moved - moved.mean(axis=0)) ** 2).sum(axis=1))
    nearest = np.zeros(len(points), dtype=np.int64)
    square = np.full(len(points), np.inf)
    farthest, radius = np.full(len(low), np.inf), np.zeros(len(chosen))
    steps = range(0, len(chosen), STEPS)
    for first in track(steps, label, len(chosen), "point", visible, weight=lambda _: STEPS):
        part = slice(0, min(first + STEPS, len(chosen)))
        done = _pick(
            moved,
            bounds,
            low,
            high,
            first,
            chosen[part],
            nearest,
            square,
            farthest,
            radius[part],
        )
        if done < part.stop:
            chosen, radius = chosen[:done], radius[:done]
            break
    back = np.empty(len(points), dtype=np.int64)
    back[order] = nearest
    return Cover(order[chosen], back, radius)
