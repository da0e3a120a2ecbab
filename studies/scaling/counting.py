"""A communicator that counts what goes over it, and a linear solver that is timed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from solver.assembly.system import System
from solver.hcms.counts import Tally
from solver.linear import Inverse, LinearSolver

Array = NDArray[np.float64]


class CountingComm(MPI.Intracomm):  # type: ignore[misc]
    """The ranks of another communicator; counts messages, bytes and waiting of a phase.

    A collective call counts as one message of its payload each way in every one of log2(ranks)
    rounds.  What libraries send on their own, as MUMPS does, is not seen.
    """

    # petsc4py knows communicators by the module that their class is from.
    __module__ = MPI.Intracomm.__module__

    tally: Tally
    rounds: int

    @classmethod
    def of(cls, comm: MPI.Comm) -> CountingComm:
        """Counting stand-in for `comm`."""
        counting: CountingComm = cls(comm)
        counting.tally = Tally()
        counting.rounds = rounds(comm.size)
        return counting

    @contextmanager
    def phase(self) -> Iterator[Tally]:
        """Count and time the body."""
        before, self.tally = self.tally, Tally()
        try:
            with self.tally.running():
                yield self.tally
        finally:
            self.tally = before

    def Isend(self, buf: Any, dest: int, tag: int = 0) -> MPI.Request:  # noqa: N802
        """Count a message."""
        self.tally.messages += 1
        self.tally.bytes += buf.nbytes
        return super().Isend(buf, dest, tag)

    def Allreduce(self, sendbuf: Any, recvbuf: Any, op: MPI.Op = MPI.SUM) -> None:  # noqa: N802
        """Count a reduction over the ranks."""
        self._collective(recvbuf.nbytes)
        with self.tally.idle():
            super().Allreduce(sendbuf, recvbuf, op)

    def bcast(self, obj: Any, root: int = 0) -> Any:
        """Count a broadcast of any value by the arrays in it."""
        with self.tally.idle():
            value = super().bcast(obj, root)
        self._collective(_array_bytes(value))
        return value

    def _collective(self, size: int) -> None:
        self.tally.messages += self.rounds
        self.tally.bytes += self.rounds * size


def rounds(ranks: int) -> int:
    """Rounds of a collective call: log2 of the number of ranks, rounded up.

    Examples
    --------
    >>> [rounds(ranks) for ranks in (1, 2, 3, 4, 1024)]
    [0, 1, 2, 2, 10]
    """
    return (ranks - 1).bit_length()


def _array_bytes(value: Any) -> int:
    if isinstance(value, (tuple, list)):
        return sum(_array_bytes(part) for part in value)
    return int(getattr(value, "nbytes", 0))


class TimedLinearSolver(LinearSolver):
    """A linear solver whose factorisations and solves are tallied.

    Attributes
    ----------
    factor, solving
        Tallies of this rank.
    """

    factor: Tally
    solving: Tally

    @classmethod
    def of(cls, linear: LinearSolver) -> TimedLinearSolver:
        """Timed stand-in for `linear`, with the same plan."""
        timed = cls.__new__(cls)
        timed.__dict__.update(linear.__dict__)
        timed.factor, timed.solving = Tally(), Tally()
        return timed

    def inverse(self, system: System, shift: float) -> Inverse:
        """Inverse whose making is timed, and whose solves will be."""
        with self.factor.running():
            inverse = super().inverse(system, shift)
        return _TimedInverse(inverse, self.solving)


class _TimedInverse:
    def __init__(self, inverse: Inverse, tally: Tally) -> None:
        self.shift = inverse.shift
        self.exact = inverse.exact
        self.negative = inverse.negative
        self._inverse = inverse
        self._tally = tally

    def solve(self, block: Array) -> Array:
        with self._tally.running():
            return self._inverse.solve(block)

    def destroy(self) -> None:
        self._inverse.destroy()
