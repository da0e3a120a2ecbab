"""What a multifrontal factorisation needs to know of the sparsity alone."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from carillon.arrays import Index
from carillon.processes.threads import split
from solver.linear.dissection import Fronts, dissect

PANEL = 120
"""Number of rows of a front that are eliminated together."""
STRIP = 192
"""Number of columns of W, and of rows of an update, that lie together in memory: whole nodes."""
BRANCHES = 3
"""Least number of branches for each thread, since their work is not equal."""
MEMORY_MARGIN = 1.2
"""Memory of fronts and updates as a multiple of the need of one thread, since several are at
work."""


@dataclass(frozen=True)
class Part:
    """Some fronts with the rows that they eliminate, and those beyond that they are coupled to."""

    fronts: Index
    """Their numbers, ascending."""
    positions: Index
    beyond: Index
    """Positions in the elimination order of the part's own rows and of the rows beyond,
    ascending."""
    first: Index
    """(fronts + 1,) first own row of each front, one a node."""
    near: Index
    near_offset: Index
    """Rows that each front is coupled to, in compressed form: own rows, then rows beyond."""

    def rows_of(self, positions: Index) -> Index:
        """Rows of positions that the part has: own rows, then rows beyond."""
        if not len(self.positions):
            return np.searchsorted(self.beyond, positions)
        place = np.minimum(np.searchsorted(self.positions, positions), len(self.positions) - 1)
        outside = len(self.positions) + np.searchsorted(self.beyond, positions)
        return np.where(self.positions[place] == positions, place, outside)

    @classmethod
    def of_fronts(cls, whole: Fronts, fronts: Index) -> Part:
        """Part of these fronts, which holds all that lies between any of them in the tree."""
        none = np.empty(0, dtype=np.int64)
        starts, stops = whole.first[fronts], whole.first[fronts + 1]
        positions = np.concatenate([none, *map(np.arange, starts, stops)])
        boundary = [whole.boundary[front] for front in fronts]
        near = np.concatenate([none, *boundary])
        beyond = np.setdiff1d(near, positions)
        counts = np.array([len(rows) for rows in boundary], dtype=np.int64)
        part = cls(
            fronts,
            positions,
            beyond,
            np.concatenate([[0], np.cumsum(stops - starts)]),
            near,
            np.concatenate([[0], np.cumsum(counts)]),
        )
        return replace(part, near=part.rows_of(near))


@dataclass(frozen=True)
class Shares:
    """All fronts in parts that threads work on: branches of the tree, and single fronts above."""

    parts: list[Part]
    """Children before parents."""
    parent: list[int]
    """Number of each part's parent, -1 for a root."""
    children: list[list[int]]
    """Numbers of each part's children."""
    inherited: list[Index]
    """Rows of each part's `beyond` in its parent: own rows, then rows beyond."""

    @classmethod
    def of_ranges(cls, whole: Fronts, ranges: list[tuple[int, int]]) -> Shares:
        """Parts of consecutive fronts, the last of which is above all the others."""
        parts = [Part.of_fronts(whole, np.arange(*each)) for each in ranges]
        part_of = np.repeat(np.arange(len(parts)), [stop - start for start, stop in ranges])
        above = whole.parent[[stop - 1 for _, stop in ranges]]
        parent = [int(part_of[front]) if front >= 0 else -1 for front in above]
        children: list[list[int]] = [[] for _ in parts]
        inherited = []
        for number, (part, place) in enumerate(zip(parts, parent, strict=True)):
            rows = part.beyond[:0]
            if place >= 0:
                children[place].append(number)
                rows = parts[place].rows_of(part.beyond)
            inherited.append(rows)
        return cls(parts, parent, children, inherited)


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
        self.pivot_offset = np.concatenate([[0], np.cumsum([_pivot_entries(n) for n in own])])
        self.coupling_offset = np.concatenate([[0], np.cumsum(own * outside)])
        self.bytes_of_updates = int(8 * MEMORY_MARGIN * self._most_at_a_time(own, outside))
        kept = self.pivot_offset[-1] + self.coupling_offset[-1]
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
            self._shares[threads] = Shares.of_ranges(self.fronts, self._ranges(threads))
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


def _pivot_entries(n: int) -> int:
    """Entries of the panels of n own rows, each from its first column on."""
    return sum((stop - start) * (n - start) for start, stop in split(n, 1, PANEL))


def packed_size(rows: int) -> int:
    """Entries of a symmetric matrix whose upper triangle is kept in strips of rows."""
    strips, rest = divmod(rows, STRIP)
    return strips * STRIP * rows - STRIP * STRIP * strips * (strips - 1) // 2 + rest * rest
