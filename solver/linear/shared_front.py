"""A front that several ranks hold by strips of its rows: who holds which, and its assembly.

What depends on the mesh alone; `solver.linear.shared_factor` eliminates.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from carillon.arrays import Array, Index
from carillon.numerics.simd import compiler
from carillon.processes.mpi import MPI
from carillon.processes.threads import split
from solver.linear.panels import STRIP

compiled = compiler(Path(__file__))


class Strips:
    """Rows of a symmetric matrix in strips that the ranks of a group hold in turn.

    A strip is a rectangle, from the first diagonal entry of its rows to the last column; what is
    left of the diagonal in it is anything.

    Attributes
    ----------
    bounds
        (strips + 1,) first row of each strip.
    mine
        Numbers of this rank's strips, and `place` where each begins in the data.
    start
        (rows,) place in the data of what would be a row's first column; of rows held here.
    """

    def __init__(self, bounds: Index, rank: int, ranks: int) -> None:
        self.bounds = bounds
        self.rows = int(bounds[-1])
        self.mine = range(rank, len(bounds) - 1, ranks)
        self.place: dict[int, int] = {}
        self.start = np.zeros(self.rows, dtype=np.int64)
        self.size = 0
        for strip in self.mine:
            first, stop = int(bounds[strip]), int(bounds[strip + 1])
            self.place[strip] = self.size
            width = self.rows - first
            self.start[first:stop] = self.size - first + width * np.arange(stop - first)
            self.size += (stop - first) * width

    def of(self, data: Array, strip: int) -> Array:
        """One of this rank's strips (rows, columns from its first row on)."""
        first, stop = int(self.bounds[strip]), int(self.bounds[strip + 1])
        width = self.rows - first
        place = self.place[strip]
        return data[place : place + (stop - first) * width].reshape(stop - first, width)


@dataclass(frozen=True)
class Child:
    """Rows that half of the ranks have not eliminated and hold in strips."""

    ranks: range
    """Ranks in the group that hold its strips in turn."""
    owner: Index
    """(rows,) which of them holds each row."""
    places: Index
    """(rows,) the same rows in the parent's front; ascending."""


class SharedFront:
    """Rows, their holders and their messages, of a front that the ranks of a group share.

    Parameters
    ----------
    comm
        The group's ranks.
    own, beyond
        Number of unknowns that the front eliminates, and of others that they are coupled to.
    children
        What the two halves of the group leave.

    Attributes
    ----------
    panels
        Number of strips of own rows, which come before those of the rows beyond.
    owner
        (own + beyond,) rank of the group that holds each row.
    order
        (own,) own rows by rank, as they come out of an exchange; `counts` so many a rank.
    start_beyond
        (beyond,) place in the data where each row begins of those that the elimination leaves.
    """

    def __init__(self, comm: MPI.Comm, own: int, beyond: int, children: list[Child]) -> None:
        self.comm = comm
        self.own, self.beyond = own, beyond
        bounds = bounds_of(own, beyond)
        self.panels = len(split(own, 1, STRIP))
        self.strips = Strips(bounds, comm.rank, comm.size)
        self.start_beyond = self.strips.start[own:] + own
        self.owner = owner = _owner(bounds, comm.size)
        self.counts = [int((owner[:own] == rank).sum()) for rank in range(comm.size)]
        self.order = np.argsort(owner[:own], kind="stable")
        self.child = next(child for child in children if comm.rank in child.ranks)
        self._sent = [
            _rows(self.child, comm.rank - self.child.ranks.start, owner == rank)
            for rank in range(comm.size)
        ]
        self._received = [
            (child, _rows(child, rank, owner == comm.rank))
            for child in children
            for rank in range(len(child.ranks))
        ]

    @property
    def bytes(self) -> int:
        """Memory of the front on this rank while it is made, and of what it keeps."""
        return 8 * (
            2 * self.strips.size + self.counts[self.comm.rank] * (3 * self.own + self.beyond)
        )

    def assembled(self, data: Array, start: Index) -> Array:
        """This rank's strips of the sum of what the two halves leave; collective.

        Parameters
        ----------
        data, start
            This rank's part of the half that it is in: where each row begins in the data.
        """
        child = self.child
        counts = [_size(child, rows) for rows in self._sent]
        packed = np.empty(sum(counts))
        place = 0
        for rows, count in zip(self._sent, counts, strict=True):
            _pack(data, start, rows, len(child.places), packed[place : place + count])
            place += count
        sizes = [_size(child, rows) for child, rows in self._received]
        received = np.empty(sum(sizes))
        self.comm.Alltoallv((packed, counts), (received, sizes))
        del packed
        result = np.zeros(self.strips.size)
        place = 0
        for (child, rows), size in zip(self._received, sizes, strict=True):
            part = received[place : place + size]
            _add(part, rows, child.places, result, self.strips.start)
            place += size
        return result


def bounds_of(own: int, beyond: int) -> Index:
    """First rows of the strips of a front, and its number of rows."""
    panels = [stop for _, stop in split(own, 1, STRIP)]
    rest = [*range(own + STRIP, own + beyond, STRIP), own + beyond] if beyond else []
    return np.array([0, *panels, *rest], dtype=np.int64)


def _owner(bounds: Index, ranks: int) -> Index:
    return np.repeat(np.arange(len(bounds) - 1) % ranks, np.diff(bounds))


def owners(own: int, beyond: int, ranks: int) -> Index:
    """Rank, of so many, that holds each of the rows beyond (beyond,) of a front."""
    return _owner(bounds_of(own, beyond), ranks)[own:]


def _rows(child: Child, holder: int, chosen: Array) -> Index:
    """Rows of a child that one of its ranks holds and that are `chosen` in the parent."""
    return np.flatnonzero((child.owner == holder) & chosen[child.places])


def _size(child: Child, rows: Index) -> int:
    """Number of entries right of the diagonal, and on it, of some rows."""
    return int((len(child.places) - rows).sum())


@compiled
def _pack(data, start, rows, width, packed):  # type: ignore[no-untyped-def]
    place = 0
    for row in rows:
        for column in range(row, width):
            packed[place] = data[start[row] + column]
            place += 1


@compiled
def _add(packed, rows, places, data, start):  # type: ignore[no-untyped-def]
    place = 0
    for row in rows:
        first = start[places[row]]
        for column in range(row, len(places)):
            data[first + places[column]] += packed[place]
            place += 1
