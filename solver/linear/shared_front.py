"""A front that several ranks hold by strips of its rows: its elimination, and its part in solves.

The own rows are swept out (Goodnight 1979) a strip at a time, which leaves minus their inverse, the
product of the inverse with what couples them to the rows beyond, and what the elimination leaves of
these.  A solve then is products with dense rows, with two exchanges on the way up and one down.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mpi4py import MPI

from carillon.arrays import Array, Index
from carillon.errors import LocalConvergenceError
from carillon.numerics.simd import compiler
from carillon.processes.threads import in_parallel, split
from solver.linear.elimination import inverse_of
from solver.linear.plan import PANEL, STRIP

compiled = compiler(Path(__file__))

COLUMNS = 512
"""Columns of a strip that are updated together, so that the product stays in the cache."""


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
        self.ranks = ranks
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
    """What the elimination of half of the ranks leaves: rows from `first` on of their strips."""

    ranks: range
    """Ranks in the group that hold its strips in turn."""
    owner: Index
    """(rows,) which of them holds each row."""
    places: Index
    """(rows,) the same rows in the parent's front; ascending."""


class SharedFront:
    """What depends on the mesh alone of a front that the ranks of a group share.

    Parameters
    ----------
    comm
        The group's ranks.
    own, beyond
        Number of unknowns that the front eliminates, and of others that they are coupled to.
    children
        What the two halves of the group leave.
    """

    def __init__(self, comm: MPI.Comm, own: int, beyond: int, children: list[Child]) -> None:
        self.comm = comm
        self.own, self.beyond = own, beyond
        bounds = _bounds(own, beyond)
        self.panels = len(split(own, 1, PANEL))
        self.strips = Strips(bounds, comm.rank, comm.size)
        owner = _owner(bounds, comm.size)
        self.counts = [int((owner[:own] == rank).sum()) for rank in range(comm.size)]
        # Own rows by rank, as they come out of an exchange.
        self.order = np.argsort(owner[:own], kind="stable")
        self.mine = np.flatnonzero(owner[:own] == comm.rank)
        self._children = children
        half = next(n for n, child in enumerate(children) if comm.rank in child.ranks)
        self.child = children[half]
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
        return 8 * (2 * self.strips.size + len(self.mine) * (2 * self.own + self.beyond))

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

    def left(self, data: Array) -> tuple[Array, Index]:
        """What the elimination leaves of the rows beyond: the data, and where each row begins."""
        return data, self.strips.start[self.own :] + self.own


class SharedFactor:
    """A front's own rows, eliminated: this rank's part.

    Of the pivots of this rank's strips `negative` are negative; `failed` says that one of anyone's
    is zero to rounding.
    """

    def __init__(self, front: SharedFront, data: Array, threads: int = 1) -> None:
        """Sweep out the own rows of the front whose strips are `data`; collective."""
        self._front = front
        self.negative = 0
        self.failed = False
        for panel in range(front.panels):
            self._sweep(data, panel, threads)
            if self.failed:
                return
        self._inverse, self._coupling = self._rows(data)

    def _sweep(self, data: Array, panel: int, threads: int) -> None:
        front = self._front
        strips = front.strips
        first, stop = int(strips.bounds[panel]), int(strips.bounds[panel + 1])
        size = stop - first
        column, inverse = self._column(data, panel, threads)
        if inverse is None:
            self.failed = True
            return

        def update(strip: int) -> None:
            rows = strips.of(data, strip)
            if strip == panel:
                rows[:, size:] = inverse @ rows[:, size:]
                rows[:, :size] = -inverse
                return
            top, end = int(strips.bounds[strip]), int(strips.bounds[strip + 1])
            scaled = column[top:end] @ inverse
            for begin, last in split(strips.rows - top, 1, COLUMNS):
                rows[:, begin:last] -= scaled @ column[top + begin : top + last].T
            if strip < panel:
                rows[:, first - top : stop - top] = scaled

        in_parallel(update, [(strip,) for strip in strips.mine], threads)

    def _column(self, data: Array, panel: int, threads: int) -> tuple[Array, Array | None]:
        """Columns (rows, w) of a panel of all ranks' strips, its own rows zero, and its inverse."""
        front = self._front
        strips, comm = front.strips, front.comm
        first, stop = int(strips.bounds[panel]), int(strips.bounds[panel + 1])
        size, holder = stop - first, panel % comm.size
        above = [list(range(rank, panel, comm.size)) for rank in range(comm.size)]
        lengths = np.diff(strips.bounds)
        counts = [int(sum(lengths[s] for s in each)) for each in above]
        counts[holder] += size + strips.rows - stop
        part = np.empty((counts[comm.rank], size))
        place = 0
        for strip in above[comm.rank]:
            top = int(strips.bounds[strip])
            rows = strips.of(data, strip)
            part[place : place + len(rows)] = rows[:, first - top : stop - top]
            place += len(rows)
        if comm.rank == holder:
            rows = strips.of(data, panel)
            try:
                part[place : place + size], negative = inverse_of(rows[:, :size])
                self.negative += negative
            except LocalConvergenceError:
                # The other ranks look at the numbers: all go on, or none.
                part[place : place + size] = np.nan
            part[place + size :] = rows[:, size:].T
        gathered = np.empty((sum(counts), size))
        comm.Allgatherv(part, (gathered, [count * size for count in counts]))
        column = np.empty((strips.rows, size))
        column[first:stop] = 0.0
        place = 0
        inverse = gathered[:0]
        for rank, each in enumerate(above):
            for strip in each:
                top, end = int(strips.bounds[strip]), int(strips.bounds[strip + 1])
                column[top:end] = gathered[place : place + end - top]
                place += end - top
            if rank == holder:
                inverse = gathered[place : place + size]
                place += size
                column[stop:] = gathered[place : place + strips.rows - stop]
                place += strips.rows - stop
        return column, None if np.isnan(inverse).any() else inverse

    def _rows(self, data: Array) -> tuple[Array, Array]:
        """Rows of the inverse, columns in the order of an exchange, and of the coupling."""
        front = self._front
        strips, comm, own = front.strips, front.comm, front.own
        mine = [strip for strip in strips.mine if strip < front.panels]
        inverse = np.zeros((len(front.mine), own))
        coupling = np.empty((len(front.mine), front.beyond))
        place = 0
        for strip in mine:
            top = int(strips.bounds[strip])
            rows = strips.of(data, strip)
            inverse[place : place + len(rows), top:] = -rows[:, : own - top]
            coupling[place : place + len(rows)] = rows[:, own - top :]
            place += len(rows)
        # What is left of the diagonal lies right of it on other strips.
        above = [range(rank, front.panels, comm.size) for rank in range(comm.size)]
        bounds = strips.bounds

        def blocks(source: int, target: int) -> list[tuple[int, int]]:
            return [(s, t) for s in above[source] for t in above[target] if t > s]

        lengths = np.diff(bounds)

        def count(source: int, target: int) -> int:
            return int(sum(lengths[s] * lengths[t] for s, t in blocks(source, target)))

        sent = [count(comm.rank, target) for target in range(comm.size)]
        received = [count(source, comm.rank) for source in range(comm.size)]
        packed, arrived = np.empty(sum(sent)), np.empty(sum(received))
        place = 0
        for target in range(comm.size):
            for s, t in blocks(comm.rank, target):
                part = strips.of(data, s)[:, bounds[t] - bounds[s] : bounds[t + 1] - bounds[s]]
                packed[place : place + part.size].reshape(part.T.shape)[:] = -part.T
                place += part.size
        comm.Alltoallv((packed, sent), (arrived, received))
        row = dict(zip(mine, np.cumsum([0, *lengths[mine]])[:-1], strict=True)) if mine else {}
        place = 0
        for source in range(comm.size):
            for s, t in blocks(source, comm.rank):
                size = int(lengths[s] * lengths[t])
                block = arrived[place : place + size].reshape(lengths[t], lengths[s])
                inverse[row[t] : row[t] + lengths[t], bounds[s] : bounds[s + 1]] = block
                place += size
        for strip in mine:
            top, end = int(bounds[strip]), int(bounds[strip + 1])
            square = inverse[row[strip] : row[strip] + end - top, top:end]
            square[:] = 0.5 * (square + square.T)
        return np.ascontiguousarray(inverse[:, front.order]), coupling

    def eliminate(self, rows: Array) -> tuple[Array, Array]:
        """First half of a solve: from this rank's part of the right-hand sides; collective.

        Returns this rank's part of those of the rows beyond, and what `substitute` needs.

        Parameters
        ----------
        rows
            (own + beyond, k), to be summed over the ranks.
        """
        front = self._front
        comm, own, width = front.comm, front.own, rows.shape[1]
        parts = np.ascontiguousarray(rows[:own][front.order])
        arrived = np.empty((comm.size, len(front.mine), width))
        sizes = [count * width for count in front.counts]
        comm.Alltoallv((parts, sizes), (arrived, [arrived[0].size] * comm.size))
        mine = arrived[0]
        for part in arrived[1:]:
            mine += part
        comm.Allgatherv(mine, (parts, sizes))
        beyond = rows[own:] - self._coupling.T @ mine
        return beyond, self._inverse @ parts

    def substitute(self, begun: Array, beyond: Array) -> Array:
        """Second half of a solve: the solution (own + beyond, k); collective.

        `begun` is what `eliminate` returned, and `beyond` the solution of the rows beyond.
        """
        front = self._front
        begun -= self._coupling @ beyond
        gathered = np.empty((front.own, begun.shape[1]))
        front.comm.Allgatherv(begun, (gathered, [n * begun.shape[1] for n in front.counts]))
        solution = np.empty((front.own + front.beyond, begun.shape[1]))
        solution[front.order] = gathered
        solution[front.own :] = beyond
        return solution


def _bounds(own: int, beyond: int) -> Index:
    """First rows of the strips of a front, and its number of rows."""
    panels = [stop for _, stop in split(own, 1, PANEL)]
    rest = [*range(own + STRIP, own + beyond, STRIP), own + beyond] if beyond else []
    return np.array([0, *panels, *rest], dtype=np.int64)


def _owner(bounds: Index, ranks: int) -> Index:
    return np.repeat(np.arange(len(bounds) - 1) % ranks, np.diff(bounds))


def owners(own: int, beyond: int, ranks: int) -> Index:
    """Rank, of so many, that holds each of the rows beyond (beyond,) of a front."""
    return _owner(_bounds(own, beyond), ranks)[own:]


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
