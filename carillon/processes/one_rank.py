"""MPI of one rank, in place of `mpi4py.MPI` where mpi4py is not installed; see `mpi`.

The solver is written for any number of ranks, and on one machine it runs as one.  What it then
calls of MPI is no communication: a sum over the ranks is the number itself.  These are just the
calls that the code makes on one rank, by mpi4py's names; messages from rank to rank are none of
them, and asking for such a call is a fault of the program.

Unlike mpi4py, which copies what it sends, objects are handed on as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

T = TypeVar("T")
AnyArray = NDArray[Any]

IN_PLACE = "in place"
SUM, MAX, MIN, LAND, LOR = "sum", "max", "min", "and", "or"
COMM_TYPE_SHARED = "machine"


class Comm:
    """A communicator of one rank.

    Examples
    --------
    >>> COMM_WORLD.rank, COMM_WORLD.size, COMM_WORLD.allreduce(3, SUM), COMM_WORLD.allgather(3)
    (0, 1, 3, [3])
    """

    rank = 0
    size = 1

    def barrier(self) -> None:
        """Nobody to wait for."""

    Barrier = barrier

    def bcast(self, value: T, root: int = 0) -> T:
        """The value of rank 0."""
        return value

    def allreduce(self, value: T, op: str = SUM) -> T:
        """The only value, by any operation."""
        return value

    def gather(self, value: T, root: int = 0) -> list[T]:
        """The values of all ranks."""
        return [value]

    def allgather(self, value: T) -> list[T]:
        """The values of all ranks."""
        return [value]

    def alltoall(self, values: Sequence[T]) -> list[T]:
        """The values of all ranks for this one."""
        return list(values)

    def Allreduce(self, sent: AnyArray | str, received: AnyArray, op: str = SUM) -> None:  # noqa: N802
        """The only array, by any operation."""
        if not isinstance(sent, str):
            received[...] = sent

    def Allgather(self, sent: AnyArray, received: AnyArray) -> None:  # noqa: N802
        """The arrays of all ranks, one after the other."""
        received.reshape(-1)[:] = np.ravel(sent)

    def Gatherv(  # noqa: N802
        self, sent: AnyArray, received: tuple[AnyArray, Sequence[int]] | None, root: int = 0
    ) -> None:
        """The arrays of all ranks, of which each has as many entries as is given."""
        assert received is not None  # as it is on the other ranks
        self.Allgather(sent, received[0])

    def Split_type(self, kind: str) -> Comm:  # noqa: N802
        """The ranks of this machine."""
        return self

    def Free(self) -> None:  # noqa: N802
        """Nothing to free."""


class NoMessage:
    """A message under way, of which one rank has none."""

    @staticmethod
    def Waitall(requests: Sequence[NoMessage]) -> None:  # noqa: N802
        """Wait for messages: there are none."""
        assert not requests


def Is_initialized() -> bool:  # noqa: N802
    """Whether ranks can be asked for."""
    return True


Request = NoMessage
COMM_SELF = COMM_WORLD = Comm()
