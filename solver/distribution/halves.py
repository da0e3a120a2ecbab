"""Nodes of a lattice in halves of equal work, by planes through which few of them are cut.

The work is that of eliminating each half by itself, which for equally many nodes is more where
they lie in a compact body than where they lie in its ears.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Index
from carillon.errors import UserError
from solver.distribution.planes import best_plane
from solver.distribution.rank_groups import RankGroup, groups_of

SLACK = 0.02
"""Share of the nodes by which a half may miss its own, for a plane of fewer nodes."""
TRIES = 6
"""Cuts that are tried to share the work."""
GROWTH = 2.0
"""Exponent by which the ratio of the halves' work grows with that of their nodes, about."""
EVEN = 0.03
"""Difference of the halves' work from their share at which the search ends."""
FEW = 500
"""Nodes of a region that is not cut further to estimate its work."""


class NodesToHalve(Protocol):
    """Nodes that are to be halved."""

    def __len__(self) -> int: ...

    def beyond(self, share: float, fewest: tuple[int, int]) -> Index:
        """Nodes of the second half, where the first has about this share of them.

        A half has `fewest` nodes at least.
        """

    def works(self, second: Index) -> tuple[float, float]:
        """Products of eliminating the first half and the second, about."""


def cut_in_parts(
    count: int, parts: int, body_of: Callable[[Index], NodesToHalve]
) -> NDArray[np.int32]:
    """Part (count,) of each node.

    Parts are halves of halves, see `groups_of`, and have equal work, about. Raises UserError if
    there are more parts than nodes.

    Parameters
    ----------
    count
        Number of nodes.
    body_of
        Body of some ascending nodes, which are counted from 0 in it.
    """
    if parts > count:
        raise UserError(f"{parts} ranks for {count} nodes: every rank needs one; start fewer ranks")
    part = np.zeros(count, dtype=np.int32)
    # A part is the number of its first rank until it is halved.
    for group in reversed(list(groups_of(0, parts))):
        nodes = np.flatnonzero(part == group.first)
        part[nodes[_second_half(body_of(nodes), group)]] = group.middle
    return part


def _second_half(body: NodesToHalve, group: RankGroup) -> Index:
    """Nodes of the second half of a group's ranks."""
    ranks = group.middle - group.first, group.stop - group.middle
    best = tried = body.beyond(ranks[0] / sum(ranks), ranks)
    if len(body) <= 2 * FEW:
        return best
    # Logarithms of the ratio of the halves' nodes, and of their work for each rank.
    low, high, least = (-np.inf, -np.inf), (np.inf, np.inf), np.inf
    for _ in range(TRIES):
        works = body.works(tried)
        sizes = len(body) - len(tried), len(tried)
        here = np.log(sizes[0] / sizes[1]), np.log(works[0] * ranks[1] / works[1] / ranks[0])
        if abs(here[1]) < least:
            best, least = tried, abs(here[1])
        if least < EVEN:
            break
        if here[1] < 0.0:
            low = max(low, here)
        else:
            high = min(high, here)
        if np.isfinite(high[0] - low[0]):
            odds = low[0] - low[1] * (high[0] - low[0]) / (high[1] - low[1])
        else:
            odds = here[0] - here[1] / GROWTH
        last, tried = tried, body.beyond(1.0 / (1.0 + np.exp(-odds)), ranks)
        if np.array_equal(tried, last):
            break  # as would all that follow
    return best


def cut_by_planes(lattice: Index, parts: int, steps: int = 1) -> NDArray[np.int32]:
    """Part (n,) of each node, by its integer coordinates (n, 3); see `cut_in_parts`.

    Parameters
    ----------
    lattice, steps
        See `solver.linear.dissection.dissect`.

    Examples
    --------
    >>> cut_by_planes(np.array([[0, 0, 0], [3, 0, 0], [1, 0, 0], [2, 0, 0]]), 2)
    array([0, 1, 0, 1], dtype=int32)
    """
    return cut_in_parts(len(lattice), parts, lambda nodes: _Lattice(lattice[nodes], steps))


class _Lattice:
    """Nodes on a lattice, whose planes `steps` apart separate elements."""

    def __init__(self, lattice: Index, steps: int) -> None:
        self._lattice, self._steps = lattice, steps
        self._axes = [_Axis.of(lattice, axis) for axis in range(3)]

    def __len__(self) -> int:
        return len(self._lattice)

    def beyond(self, share: float, fewest: tuple[int, int]) -> Index:
        return _beyond(self._axes, share, fewest)

    def works(self, second: Index) -> tuple[float, float]:
        first = np.setdiff1d(np.arange(len(self)), second)
        halves = self._lattice[first], self._lattice[second]
        return (
            elimination_work(*halves, self._steps),
            elimination_work(*halves[::-1], self._steps),
        )


@dataclass(frozen=True)
class _Axis:
    """Nodes in the order of one axis, those of one plane row by row."""

    order: Index
    first: Index
    """Place in the order of each plane's first node."""
    size: Index
    """Number of nodes in each plane."""

    @classmethod
    def of(cls, lattice: Index, axis: int) -> _Axis:
        order = np.lexsort([lattice[:, axis - 2], lattice[:, axis - 1], lattice[:, axis]])
        _, first, size = np.unique(lattice[order, axis], return_index=True, return_counts=True)
        return cls(order, first, size)


def _beyond(axes: list[_Axis], share: float, fewest: tuple[int, int]) -> Index:
    """Nodes of the second half, where the first has about this share of them.

    A half has `fewest` nodes at least.
    """
    count = len(axes[0].order)
    exact = min(max(round(share * count), fewest[0]), count - fewest[1])
    best = np.inf, np.arange(0)
    for axis in axes:
        first, size, stop = axis.first, axis.size, exact
        cost = float(size[int(np.searchsorted(first, exact, side="right")) - 1])
        for number in np.flatnonzero(np.abs(first - share * count) <= SLACK * count):
            fits = fewest[0] <= first[number] <= count - fewest[1]
            # Between two planes either of them separates.
            least = float(min(size[number], size[max(number - 1, 0)]))
            if fits and least <= cost:
                stop, cost = int(first[number]), least
        if cost < best[0]:
            best = cost, axis.order[stop:]
    return best[1]


def elimination_work(lattice: Index, others: Index, steps: int = 1) -> float:
    """Products of eliminating the nodes (n, 3) of a lattice, estimated from their dissection.

    Those of the `others` (m, 3) that lie around them are eliminated later.
    """
    regions, work = [(lattice, _near(others, lattice, 1))], 0.0
    while regions:
        nodes, around = regions.pop()
        axis, value = -1, 0
        if len(nodes) > FEW:
            axis, value = best_plane(nodes, np.arange(len(nodes)), steps)
        if axis < 0:
            work += work_of_few(len(nodes), len(around))
            continue
        own = nodes[nodes[:, axis] == value]
        work += work_of_front(len(own), len(around))
        near = np.concatenate([around, own])
        for half in (nodes[nodes[:, axis] < value], nodes[nodes[:, axis] > value]):
            regions.append((half, _near(near, half, steps)))
    return work


def work_of_front(own: int, around: int) -> float:
    """Products of eliminating the `own` nodes of a front, which are coupled to those `around`."""
    rows, beyond = 3.0 * own, 3.0 * around
    return rows**3 / 3.0 + rows**2 * beyond + rows * beyond**2


def work_of_few(nodes: int, around: int) -> float:
    """Products of eliminating the nodes of a region that is not cut further, about."""
    # As in a cube, whose plane has so many unknowns.
    plane = 3.0 * nodes ** (2.0 / 3.0)
    return 2.0 * plane**3 + plane * (3.0 * around) ** 2


def _near(nodes: Index, others: Index, steps: int) -> Index:
    """Nodes in the box of the `others`, widened by so many steps."""
    low, high = others.min(axis=0) - steps, others.max(axis=0) + steps
    return nodes[((nodes >= low) & (nodes <= high)).all(axis=1)]
