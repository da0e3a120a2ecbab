"""What a multifrontal factorisation needs to know of the sparsity alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.threads import split
from solver.linear.dissection import Fronts, dissect

Index = NDArray[np.int64]

PANEL = 120
"""Rows of a front that are eliminated together."""
BRANCHES = 3
"""Branches for each thread, at least: their work is not equal."""
UPDATES_FRACTION = 1.3
"""Memory at its peak, when updates wait for their parents, as a share of what the factor takes."""


@dataclass(frozen=True)
class Part:
    """Some fronts with the rows that they eliminate, and those beyond that they are coupled to.

    Attributes
    ----------
    fronts
        Their numbers, ascending.
    positions, beyond
        Positions in the elimination order of the part's own rows and of the rows beyond, ascending.
    first
        (fronts + 1,) first own row of each front, one a node.
    near, near_offset
        Rows that each front is coupled to, in compressed form: own rows, then rows beyond.
    """

    fronts: Index
    positions: Index
    beyond: Index
    first: Index
    near: Index
    near_offset: Index

    @classmethod
    def of_fronts(cls, whole: Fronts, fronts: Index) -> Part:
        """Part of these fronts, which holds all that lies between any of them in the tree."""
        none = np.empty(0, dtype=np.int64)
        starts, stops = whole.first[fronts], whole.first[fronts + 1]
        positions = np.concatenate([none, *map(np.arange, starts, stops)])
        boundary = [whole.boundary[front] for front in fronts]
        near = np.concatenate([none, *boundary])
        beyond = np.setdiff1d(near, positions)
        # Outside the part all rows come later than the own ones that are coupled to them.
        place = np.searchsorted(positions, near)
        own = positions[np.minimum(place, len(positions) - 1)] == near if len(near) else none > 0
        local = np.where(own, place, len(positions) + np.searchsorted(beyond, near))
        counts = np.array([len(rows) for rows in boundary], dtype=np.int64)
        return cls(
            fronts,
            positions,
            beyond,
            np.concatenate([[0], np.cumsum(stops - starts)]),
            local,
            np.concatenate([[0], np.cumsum(counts)]),
        )


@dataclass(frozen=True)
class Shares:
    """Branches of the tree, which threads work on beside each other, and the fronts above them."""

    branches: list[Part]
    top: Part


class Plan:
    """What a factorisation needs to know of the sparsity alone: made once, used for any material.

    Parameters
    ----------
    lattice
        (n, 3) integer coordinates of the nodes.
    indptr, indices
        Node graph in compressed rows; the data of `Factor` follow it.
    options
        Others of `solver.linear.dissection.dissect`.
    """

    def __init__(self, lattice: Index, indptr: Index, indices: Index, **options: Any) -> None:
        self.fronts: Fronts = dissect(lattice, indptr, indices, **options)
        fronts = self.fronts
        self.position = fronts.position
        self.children = fronts.children()
        self.entries = fronts.entries(indptr, indices)
        self.places = fronts.places()
        own = 3 * np.diff(fronts.first)
        outside = 3 * np.array([len(boundary) for boundary in fronts.boundary])
        self.pivot_offset = np.concatenate([[0], np.cumsum([_pivot_entries(n) for n in own])])
        self.coupling_offset = np.concatenate([[0], np.cumsum(own * outside)])
        self.bytes = int(UPDATES_FRACTION * 8 * (self.pivot_offset[-1] + self.coupling_offset[-1]))
        self._work = 2 * own**2 + 4 * own * outside
        self._shares: dict[int, Shares] = {}

    def shares(self, threads: int) -> Shares:
        """How the fronts are shared among threads; made once for each number of them."""
        if threads not in self._shares:
            branches = self._branches(threads)
            inside = np.concatenate([np.arange(*branch) for branch in branches])
            top = np.setdiff1d(np.arange(len(self.fronts)), inside)
            self._shares[threads] = Shares(
                [Part.of_fronts(self.fronts, np.arange(*branch)) for branch in branches],
                Part.of_fronts(self.fronts, top),
            )
        return self._shares[threads]

    def _branches(self, threads: int) -> list[tuple[int, int]]:
        """Half-open ranges of fronts, whole branches of the tree, that threads take in turn.

        The largest come first.
        """
        parent = self.fronts.parent
        work = self._work.astype(float)
        size = np.ones(len(parent), dtype=np.int64)
        for front, above in enumerate(parent):
            if above >= 0:
                work[above] += work[front]
                size[above] += size[front]
        chosen = [int(front) for front in np.flatnonzero(parent < 0)]
        if threads > 1:
            largest = work[chosen].sum() / (BRANCHES * threads)
            while True:
                big = max(chosen, key=lambda front: work[front])
                if work[big] <= largest or not self.children[big]:
                    break
                chosen.remove(big)
                chosen += self.children[big]
        chosen.sort(key=lambda front: -work[front])
        return [(front + 1 - int(size[front]), front + 1) for front in chosen]


def _pivot_entries(n: int) -> int:
    """Entries of the panels of n own rows, each from its first column on."""
    return sum((stop - start) * (n - start) for start, stop in split(n, 1, PANEL))
