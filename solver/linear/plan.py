"""What a multifrontal factorisation needs to know of the sparsity alone."""

from __future__ import annotations

from typing import Any

import numpy as np

from carillon.arrays import Index
from solver.linear.dissection import Fronts, dissect
from solver.linear.panels import packed_size, pivot_entries
from solver.linear.shares import BRANCHES, Shares

MEMORY_MARGIN = 1.2
"""Memory of fronts and updates as a multiple of the need of one thread, since several are at
work."""


class Plan:
    """What a factorisation needs to know of the sparsity alone: made once, used for any material.

    Parameters
    ----------
    lattice
        (n, 3) integer coordinates of the nodes.
    indptr, indices
        Node graph in compressed rows; the data of `Factor` follow it.
    options
        Those of `dissect`.

    Attributes
    ----------
    kept
        Number of nodes that are not eliminated.
    kept_entries
        (e, 3) block entries among them: row and column, of which none is before the row, and
        number in the data.
    own_rows, outside_rows
        (fronts,) unknowns that each front eliminates, and others that these are coupled to.
    bytes, bytes_of_updates
        Memory that a factorisation takes while it is made, and without what a solve needs of it.
    operations, operations_of_solve
        Sums and products of a factorisation, and of a solve for one right-hand side.
    """

    def __init__(self, lattice: Index, indptr: Index, indices: Index, **options: Any) -> None:
        self.fronts: Fronts = dissect(lattice, indptr, indices, **options)
        fronts = self.fronts
        self.position = fronts.position
        self.kept = len(fronts.order) - int(fronts.first[-1])
        self.kept_entries = fronts.kept_entries(indptr, indices)
        self.children = fronts.children()
        self.entries = fronts.entries(indptr, indices)
        self.places = fronts.places()
        own = self.own_rows = 3 * np.diff(fronts.first)
        outside = self.outside_rows = 3 * np.diff(fronts.offset)
        self.pivot_offset = np.concatenate([[0], np.cumsum([pivot_entries(n) for n in own])])
        self.sign_offset = 3 * fronts.first
        self.coupling_offset = np.concatenate([[0], np.cumsum(own * outside)])
        self.bytes_of_updates = int(8 * MEMORY_MARGIN * self._most_at_a_time(own, outside))
        kept = self.pivot_offset[-1] + self.coupling_offset[-1] + self.sign_offset[-1]
        self.bytes = 8 * int(kept) + self.bytes_of_updates
        self._work = 2 * own**2 + 4 * own * outside
        self.operations_of_solve = float(self._work.sum())
        n, b = own.astype(float), outside.astype(float)
        self.operations = float((n**3 / 3.0 + n**2 * b + n * b**2).sum())
        self._shares: dict[int, Shares] = {}

    def _most_at_a_time(self, own: Index, outside: Index) -> int:
        """Numbers in a front and in the updates that wait for their parents, at the most."""
        waiting = most = 0
        for front, (n, b) in enumerate(zip(own.tolist(), outside.tolist(), strict=True)):
            most = max(most, waiting + n * (2 * n + b) + packed_size(b))
            waiting += packed_size(b)
            waiting -= sum(packed_size(int(outside[child])) for child in self.children[front])
        return most

    def shares(self, threads: int) -> Shares:
        """How the fronts are shared among threads; made once for each number of them."""
        if threads not in self._shares:
            self._shares[threads] = Shares.of_ranges(self.fronts, self._ranges(threads), self._work)
        return self._shares[threads]

    def _ranges(self, threads: int) -> list[tuple[int, int]]:
        """Half-open ranges of fronts: whole branches of similar work, and each front above them."""
        parent = self.fronts.parent
        if threads == 1:
            return [(0, len(parent))]
        work = self._work.astype(float)
        size = np.ones(len(parent), dtype=np.int64)
        for front, above in enumerate(parent):
            if above >= 0:
                work[above] += work[front]
                size[above] += size[front]
        branches = [int(front) for front in np.flatnonzero(parent < 0)]
        largest = work[branches].sum() / (BRANCHES * threads)
        alone = []
        while True:
            big = max(branches, key=lambda front: work[front])
            if work[big] <= largest or not self.children[big]:
                break
            branches.remove(big)
            branches += self.children[big]
            alone.append(big)
        ranges = [(front + 1 - int(size[front]), front + 1) for front in branches]
        return sorted(ranges + [(front, front + 1) for front in alone])
