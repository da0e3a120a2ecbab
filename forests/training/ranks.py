"""The ranks that train one model together, or one process alone."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from carillon.errors import UserError, on_all_ranks
from carillon.files.locks import locked
from forests.training.exact_sums import Sums

T = TypeVar("T")

MESSAGE_BYTES = 1 << 27
"""Length of a message of sums, about; MPI counts in 32 bits."""


class Ranks:
    """All ranks of a job; without a communicator, this process is the only one."""

    def __init__(self, comm: Any = None) -> None:
        self._comm = comm
        self.rank = 0 if comm is None else int(comm.rank)
        self.size = 1 if comm is None else int(comm.size)

    @property
    def first(self) -> bool:
        """Whether this rank writes the result and speaks for all."""
        return self.rank == 0

    def own(self, items: Sequence[T]) -> Sequence[T]:
        """This rank's share of independent items: every so-manieth, so that all advance alike."""
        return items[self.rank :: self.size]

    def from_one(self, value: T, rank: int = 0) -> T:
        """The value of one rank, on every rank."""
        return value if self._comm is None else cast(T, self._comm.bcast(value, rank))

    def total(self, count: int) -> int:
        """Sum over all ranks, on every rank."""
        return count if self._comm is None else int(self._comm.allreduce(count))

    def exchanged(self, parts: list[T]) -> list[T]:
        """What every rank has for this one, in their order; `parts`: what this one has for them."""
        return parts if self._comm is None else cast(list[T], self._comm.alltoall(parts))

    def in_order(self, mine: list[T]) -> list[T]:
        """The lists of all ranks one after the other, on the first rank; its own elsewhere."""
        if self._comm is None:
            return mine
        parts: list[list[T]] | None = self._comm.gather(mine)
        return mine if parts is None else [item for part in parts for item in part]

    def everywhere(self, mine: list[T]) -> list[T]:
        """The lists of all ranks one after the other, on every rank."""
        return self.from_one(self.in_order(mine))

    def add_up(self, sums: Sums) -> None:
        """Add the sums of all ranks on the first one; those of the others are nothing then."""
        if self._comm is None:
            return
        from carillon.processes.mpi import MPI

        sums.carry()
        operations = {"low": MPI.MIN, "high": MPI.MAX}
        for name, values in sums.arrays():
            for part in np.array_split(values, max(1, values.nbytes // MESSAGE_BYTES)):
                operation, mine = operations.get(name, MPI.SUM), np.ascontiguousarray(part)
                if self.first:
                    self._comm.Reduce(MPI.IN_PLACE, mine, operation)
                    part[:] = mine
                else:
                    self._comm.Reduce(mine, None, operation)
        if not self.first:
            sums.clear()

    @contextmanager
    def held(self, path: str | Path) -> Iterator[None]:
        """Hold a result for this job alone, see `carillon.files.locks.locked`."""
        with ExitStack() as stack:
            if self.first:
                self.agree(lambda: stack.enter_context(locked(path)))
            else:
                self.agree(lambda: None)
            yield

    def agree(self, action: Callable[[], T]) -> T:
        """The result of `action`, which refuses its input on every rank if it does on any of them.

        Raises UserError on every rank, what the first of those that refused it said.
        """
        if self._comm is None:
            return action()
        result, refusal = None, None
        try:
            result = action()
        except UserError as error:
            refusal = str(error)
        refusals = [each for each in self._comm.allgather(refusal) if each is not None]
        if refusals:
            with on_all_ranks():
                raise UserError(refusals[0])
        return cast(T, result)
