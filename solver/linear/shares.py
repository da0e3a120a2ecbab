"""How threads share the fronts of an elimination: whole branches of the tree, and fronts above.

A branch is one thread's from its leaves to its top.  All threads share each front above them: its
panels of own rows, and slices of its rows beyond.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carillon.arrays import Index
from solver.linear.dissection import Fronts
from solver.linear.panels import STRIP, panels_of

BRANCHES = 3
"""Least number of branches for each thread, since their work is not equal."""
SLICE = STRIP // 2
"""Number of rows beyond a shared front that a thread takes at a time."""
BRANCH, PANEL_OF_FRONT, SLICE_OF_FRONT = range(3)
"""Kinds of tickets."""


@dataclass(frozen=True)
class Shares:
    """Parts of the tree, consecutive fronts each, and the tickets by which threads work on them.

    In a solve each part adds what it has for rows beyond it to rows of its own, which its parent
    takes over. They follow the rows of all nodes.
    """

    ranges: list[tuple[int, int]]
    """Half-open ranges of fronts, children before parents."""
    shared: list[bool]
    """Whether all threads share the part, which is a single front then."""
    branches: list[int]
    """Numbers of the other parts, those that take the most work first."""
    rows: int
    """Nodes that a solve has rows for."""
    near: Index
    """Rows, by nodes, that each front adds to, as `Fronts.beyond`."""
    parts: Index
    """(parts, 8): its fronts' first and stop, its parent or -1, the first of its own rows for
    those beyond and their number, its panels if shared, and its tickets up the tree and down."""
    child_offset: Index
    child: Index
    """Children of each part in compressed form."""
    taken_offset: Index
    taken: Index
    """Rows, by nodes, that the rows of each part for those beyond are added to in its parent."""
    up: Index
    down: Index
    """(tickets, 4) kind, part, first and stop: the number of a panel, or a slice of rows beyond.
    Each comes after what it waits for."""

    @classmethod
    def of_ranges(cls, whole: Fronts, ranges: list[tuple[int, int]], work: Index) -> Shares:
        """Parts of consecutive fronts, the last of which is above all the others.

        Branches that take much `work` (fronts,) come first.
        """
        count = len(ranges)
        part_of = np.repeat(np.arange(count), [stop - start for start, stop in ranges])
        above = whole.parent[[stop - 1 for _, stop in ranges]]
        parent = np.where(above >= 0, part_of[above], -1)
        near = whole.beyond.copy()
        parts = np.zeros((count, 8), dtype=np.int64)
        beyond: list[Index] = []
        rows = len(whole.order)
        for number, (start, stop) in enumerate(ranges):
            last = whole.first[stop]
            span = slice(whole.offset[start], whole.offset[stop])
            outside = whole.beyond[span] >= last
            beyond.append(np.unique(whole.beyond[span][outside]))
            # What roots leave is for the nodes that are kept, which have rows.
            place = rows if parent[number] >= 0 else int(whole.first[-1])
            rows += len(beyond[-1]) if parent[number] >= 0 else 0
            near[span][outside] = place + np.searchsorted(beyond[-1], near[span][outside])
            parts[number, :5] = start, stop, parent[number], place, len(beyond[-1])
        taken = [
            _rows_in(beyond[number], whole.first[ranges[above][1]], parts[above], beyond[above])
            if above >= 0
            else beyond[number][:0]
            for number, above in enumerate(parent)
        ]
        children = [np.flatnonzero(parent == number) for number in range(count)]
        shared = [len(each) > 0 for each in children]
        for number in np.flatnonzero(shared):
            start = ranges[number][0]
            parts[number, 5] = len(panels_of(3 * int(whole.first[start + 1] - whole.first[start])))
        branches = [number for number in range(count) if not shared[number]]
        branches.sort(key=lambda number: -work[slice(*ranges[number])].sum())
        up, down = _tickets(parts, shared, branches)
        for column, tickets in ((6, up), (7, down)):
            parts[:, column] = np.bincount(tickets[:, 1], minlength=count)
        return cls(
            ranges,
            shared,
            branches,
            rows,
            near,
            parts,
            *_compressed(children),
            *_compressed(taken),
            up,
            down,
        )


def _rows_in(positions: Index, stop: int, part: Index, beyond: Index) -> Index:
    """Rows of a part for these positions, of which those before `stop` are its own."""
    return np.where(positions < stop, positions, part[3] + np.searchsorted(beyond, positions))


def _compressed(lists: list[Index]) -> tuple[Index, Index]:
    offset = np.cumsum([0, *map(len, lists)])
    return offset, np.concatenate([np.empty(0, dtype=np.int64), *lists])


def _tickets(parts: Index, shared: list[bool], branches: list[int]) -> tuple[Index, Index]:
    """Tickets up the tree and down it."""
    alone = [(BRANCH, number, 0, 0) for number in branches]
    up, down = list(alone), []
    for number in np.flatnonzero(shared):
        beyond, panels = 3 * int(parts[number, 4]), int(parts[number, 5])
        slices = [
            (SLICE_OF_FRONT, number, start, min(start + SLICE, beyond))
            for start in range(0, beyond, SLICE)
        ]
        own = [(PANEL_OF_FRONT, number, panel, panel + 1) for panel in range(panels)]
        up += own + slices
        # Nothing is to be gathered for the roots: nodes that are kept have rows.
        down.append((slices if parts[number, 2] >= 0 else []) + own[::-1])
    tickets = [ticket for each in reversed(down) for ticket in each] + alone
    return _rows_of(up), _rows_of(tickets)


def _rows_of(tickets: list[tuple[int, int, int, int]]) -> Index:
    return np.array(tickets, dtype=np.int64).reshape(-1, 4)
