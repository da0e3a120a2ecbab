"""Elimination of a front that several ranks share, and its part in solves.

The own rows are swept out (Goodnight 1979) a strip at a time, which leaves minus their inverse, the
product of the inverse with what couples them to the rows beyond, and what the elimination leaves of
these.  A solve then is products with dense rows, with two exchanges on the way up and one down.
"""

import numpy as np

from carillon.arrays import Array
from carillon.errors import LocalConvergenceError
from carillon.numerics.gemm import subtract_product
from carillon.processes.threads import in_parallel
from solver.linear.elimination import inverse_of
from solver.linear.shared_front import SharedFront


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
        self._inverse, self._coupling = _rows_of_inverse(front, data)

    def _sweep(self, data: Array, panel: int, threads: int) -> None:
        strips = self._front.strips
        first, stop = int(strips.bounds[panel]), int(strips.bounds[panel + 1])
        column, inverse = self._column(data, panel)
        self.failed = bool(np.isnan(inverse).any())
        if self.failed:
            return

        def update(strip: int) -> None:
            rows = strips.of(data, strip)
            if strip == panel:
                rows[:, stop - first :] = inverse @ rows[:, stop - first :]
                rows[:, : stop - first] = -inverse
                return
            top, end = int(strips.bounds[strip]), int(strips.bounds[strip + 1])
            scaled = column[top:end] @ inverse
            subtract_product(rows, scaled, column[top:])
            if strip < panel:
                rows[:, first - top : stop - top] = scaled

        in_parallel(update, [(strip,) for strip in strips.mine], threads)

    def _column(self, data: Array, panel: int) -> tuple[Array, Array]:
        """Columns (rows, w) of a panel, of all ranks, with zeros in its own rows; and its inverse.

        The inverse is not a number if a pivot is zero to rounding: all ranks go on, or none.
        """
        front = self._front
        strips, comm = front.strips, front.comm
        first, stop = int(strips.bounds[panel]), int(strips.bounds[panel + 1])
        size, holder = stop - first, panel % comm.size
        # Strips above have them in their columns, the panel's own in its rows.
        rows = [np.flatnonzero(front.owner[:first] == rank) for rank in range(comm.size)]
        rows[holder] = np.append(rows[holder], np.arange(first, strips.rows))
        part = np.empty((len(rows[comm.rank]), size))
        place = 0
        for strip in range(comm.rank, panel, comm.size):
            top = int(strips.bounds[strip])
            here = strips.of(data, strip)[:, first - top : stop - top]
            part[place : place + len(here)] = here
            place += len(here)
        if comm.rank == holder:
            own = strips.of(data, panel)
            try:
                part[place : place + size], negative = inverse_of(own[:, :size])
                self.negative += negative
            except LocalConvergenceError:
                part[place : place + size] = np.nan
            part[place + size :] = own[:, size:].T
        gathered, column = np.empty((strips.rows, size)), np.empty((strips.rows, size))
        comm.Allgatherv(part, (gathered, [len(each) * size for each in rows]))
        column[np.concatenate(rows)] = gathered
        inverse = column[first:stop].copy()
        column[first:stop] = 0.0
        return column, inverse

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


def _rows_of_inverse(front: SharedFront, data: Array) -> tuple[Array, Array]:
    """This rank's rows of the inverse, columns in the front's order, and of the coupling.

    What is left of the diagonal lies right of it on other ranks, or on other strips of this one.
    """
    comm, strips, own = front.comm, front.strips, front.own
    count = front.counts[comm.rank]
    right, coupling = np.zeros((count, own)), np.empty((count, front.beyond))
    place = 0
    for strip in range(comm.rank, front.panels, comm.size):
        top, stop = int(strips.bounds[strip]), int(strips.bounds[strip + 1])
        rows, here = strips.of(data, strip), slice(place, place + stop - top)
        right[here, top:] = -rows[:, : own - top]
        # Their other half comes from the transposed matrix.
        right[here, top:stop] *= 0.5
        coupling[here] = rows[:, own - top :]
        place = here.stop
    inverse = np.ascontiguousarray(right[:, front.order])
    del right
    starts = np.cumsum([0, *front.counts])
    parts = [inverse[:, starts[rank] : starts[rank + 1]] for rank in range(comm.size)]
    packed, arrived = np.concatenate([part.ravel() for part in parts]), np.empty(count * own)
    sizes = [count * other for other in front.counts]
    comm.Alltoallv((packed, sizes), (arrived, sizes))
    place = 0
    for part, other in zip(parts, front.counts, strict=True):
        part += arrived[place : place + count * other].reshape(other, count).T
        place += count * other
    return inverse, coupling
