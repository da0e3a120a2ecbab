"""Nodes in halves of equal work where planes pass through elements, since these have several sizes.

The graph of the nodes tells what then parts the halves, see `solver.distribution.cuts`; otherwise
this does what `solver.distribution.halves` does.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Index
from solver.distribution.cuts import ABOVE, BELOW, BETWEEN, halves, planes_across, sides_of
from solver.distribution.halves import FEW, cut_in_parts, work_of_few, work_of_front
from solver.distribution.quotient import Quotient

MISSED = 0.05
"""Share of the nodes by which a half may miss its own, for a plane that has half the nodes beside
it; further off is only the next plane."""


def cut_graph(lattice: Index, indptr: Index, indices: Index, parts: int) -> NDArray[np.int32]:
    """Part (n,) of each node of a graph; see `solver.distribution.halves.cut_in_parts`.

    Parameters
    ----------
    lattice, indptr, indices
        See `solver.linear.dissection.dissect`.
    """

    def body_of(nodes: Index) -> _Graph:
        return _Graph(lattice, Quotient.of_graph(lattice, indptr, indices, nodes), nodes)

    return cut_in_parts(len(lattice), parts, body_of)


class _Graph:
    """Some nodes of a graph, in groups of a quotient."""

    def __init__(self, lattice: Index, quotient: Quotient, nodes: Index) -> None:
        self._quotient = quotient
        self._numbers = np.searchsorted(nodes, quotient.nodes)
        self._lattice = lattice[nodes]

    def __len__(self) -> int:
        return len(self._lattice)

    @cached_property
    def _planes(self) -> list[tuple[Index, Index, Index]]:
        quotient = self._quotient
        graph = quotient.sizes, quotient.indptr, quotient.indices
        return [planes_across(quotient.lattice[:, axis], *graph) for axis in range(3)]

    def beyond(self, share: float, fewest: tuple[int, int]) -> Index:
        count, lowest = len(self), np.inf
        # Without a plane that leaves as many on either side as are needed, any nodes will do.
        above = np.arange(count) >= min(max(round(share * count), fewest[0]), count - fewest[1])
        for plane, below, parting in self._planes:
            missed = np.abs(below / count - share) / MISSED
            fits = (below >= fewest[0]) & (below <= count - fewest[1])
            fits &= missed <= max(missed.min(), 1.0)
            cost = np.where(fits, parting[:, :-1].min(axis=0) * (1.0 + missed), np.inf)
            best = int(cost.argmin())
            if cost[best] < lowest:
                lowest = cost[best]
                above = np.empty(count, dtype=bool)
                above[self._numbers] = np.repeat(plane > best, self._quotient.sizes)
        return np.flatnonzero(above)

    def works(self, second: Index) -> tuple[float, float]:
        half = np.zeros(len(self), dtype=np.int64)
        half[second] = 1
        of_groups = half[self._numbers[self._quotient.offset[:-1]]]
        return self._work(of_groups, BELOW), self._work(of_groups, ABOVE)

    def _work(self, half: Index, side: int) -> float:
        """Products of eliminating one side, but for what parts it from the other."""
        quotient = self._quotient
        sides = sides_of(half, 0, side, quotient.indptr, quotient.indices)
        return elimination_work(quotient, np.flatnonzero(sides == side))


def elimination_work(quotient: Quotient, groups: Index) -> float:
    """Products of eliminating some groups of nodes before all others, from their dissection."""
    regions, work = [groups], 0.0
    while regions:
        groups = regions.pop()
        sizes = quotient.sizes[groups]
        nodes, around = int(sizes.sum()), quotient.around(groups)
        if nodes <= FEW:
            work += work_of_few(nodes, around)
            continue
        side = halves(quotient.lattice[groups], sizes, *quotient.part(groups))
        work += work_of_front(int(sizes[side == BETWEEN].sum()), around)
        regions += [groups[side == each] for each in (BELOW, ABOVE) if (side == each).any()]
    return work
