"""Elimination of a front that several ranks share, and its part in solves.

The own rows are eliminated a strip at a time. What is kept of them is the inverse of the triangle
L of A = L diag(s) L^T, s being signs, and its product W with what couples them to the rows beyond.
A solve then is products with dense rows, with two exchanges on the way up and one down.
"""

import numpy as np

from carillon.arrays import Array
from carillon.errors import LocalConvergenceError
from carillon.numerics.gemm import subtract_product
from carillon.processes.mpi import MPI
from carillon.processes.threads import in_parallel
from solver.linear.elimination import roots_of
from solver.linear.shared_front import SharedFront


class SharedFactor:
    """A front's own rows, eliminated: this rank's part.

    Of the pivots of this rank's strips `negative` are negative; `failed` says that one of anyone's
    is zero to rounding.
    """

    def __init__(self, front: SharedFront, data: Array, threads: int = 1) -> None:
        """Eliminate the own rows of the front whose strips are `data`; collective."""
        self._front = front
        self.negative = 0
        self.failed = False
        count = front.counts[front.comm.rank]
        self._inverse = np.zeros((count, front.own))
        self._coupling = np.empty((count, front.beyond))
        self._signs = np.empty((count, 1))
        strips, ranks = front.strips, front.comm.size
        # Where this rank's strips of own rows begin among its rows.
        self._first: dict[int, int] = {}
        place = 0
        for strip in range(front.comm.rank, front.panels, ranks):
            first, stop = int(strips.bounds[strip]), int(strips.bounds[strip + 1])
            self._first[strip] = place
            rows = np.arange(stop - first)
            self._inverse[place + rows, first + rows] = 1.0
            place += stop - first
        for panel in range(front.panels):
            self._eliminate(data, panel, threads)
            if self.failed:
                return
        self._inverse = np.ascontiguousarray(self._inverse[:, front.order])

    def _eliminate(self, data: Array, panel: int, threads: int) -> None:
        strips = self._front.strips
        stop = int(strips.bounds[panel + 1])
        later, inverse, signs = self._panel(data, panel)
        self.failed = bool(np.isnan(signs).any())
        if self.failed:
            return

        turned_later = np.ascontiguousarray(later.T)

        def update(strip: int) -> None:
            top, end = int(strips.bounds[strip]), int(strips.bounds[strip + 1])
            turned = turned_later[top - stop : end - stop] * signs.T
            subtract_product(strips.of(data, strip), turned, turned_later[top - stop :])
            if strip in self._first:
                place = self._first[strip]
                self._inverse[place : place + end - top, :stop] -= turned @ inverse

        in_parallel(update, [(strip,) for strip in strips.mine if strip > panel], threads)

    def _panel(self, data: Array, panel: int) -> tuple[Array, Array, Array]:
        """W of a panel (w, later rows), its rows of the inverse (w, rows so far) and signs (w, 1).

        Its rank sends them to all. Signs are not numbers if a pivot is zero to rounding: all ranks
        go on, or none.
        """
        front = self._front
        strips, comm = front.strips, front.comm
        first, stop = int(strips.bounds[panel]), int(strips.bounds[panel + 1])
        size, holder = stop - first, panel % comm.size
        packed = np.empty((size, strips.rows + 1))
        later, inverse, signs = packed[:, 1 + stop :], packed[:, 1 : 1 + stop], packed[:, :1]
        if comm.rank == holder:
            own, place = strips.of(data, panel), self._first[panel]
            mine = slice(place, place + size)
            try:
                root, signs[:, 0] = roots_of(own[:, :size])
            except LocalConvergenceError:
                packed[:] = np.nan
            else:
                later[:] = root @ own[:, size:]
                inverse[:] = root @ self._inverse[mine, :stop]
                self.negative += int((signs < 0.0).sum())
                self._inverse[mine, :stop] = inverse
                self._coupling[mine] = signs * later[:, front.own - stop :]
                self._signs[mine] = signs
        comm.Bcast(packed, holder)
        return later, inverse, signs

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
        arrived = np.empty((comm.size, front.counts[comm.rank], width))
        sizes = [count * width for count in front.counts]
        comm.Alltoallv((parts, sizes), (arrived, [arrived[0].size] * comm.size))
        # In the order of the ranks, whatever came first.
        mine = arrived[0]
        for part in arrived[1:]:
            mine += part
        comm.Allgatherv(mine, (parts, sizes))
        begun = self._inverse @ parts
        beyond = rows[own:] - self._coupling.T @ begun
        begun *= self._signs
        return beyond, begun

    def substitute(self, begun: Array, beyond: Array) -> Array:
        """Second half of a solve: the solution (own + beyond, k); collective.

        `begun` is what `eliminate` returned, and `beyond` the solution of the rows beyond.
        """
        front = self._front
        begun -= self._coupling @ beyond
        gathered = np.ascontiguousarray(self._inverse.T @ begun)
        front.comm.Allreduce(MPI.IN_PLACE, gathered)
        solution = np.empty((front.own + front.beyond, begun.shape[1]))
        solution[front.order] = gathered
        solution[front.own :] = beyond
        return solution
