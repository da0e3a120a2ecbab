"""The ranks that train one model together, or one process alone."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from carillon.errors import UserError, on_all_ranks
from dataset_gen.shards import PIECE_ROWS
from forests.training.leaves import Sums

T = TypeVar("T")


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

    def own_jobs(self, jobs: range) -> range:
        """This rank's share of independent jobs, one after the other to all ranks."""
        return jobs[self.rank :: self.size]

    def own_samples(self, samples: int) -> tuple[int, int]:
        """First and past-the-last position of this rank's samples: whole pieces, in order."""
        pieces = -(-samples // PIECE_ROWS)
        begin, end = (pieces * (self.rank + k) // self.size * PIECE_ROWS for k in (0, 1))
        return min(begin, samples), min(end, samples)

    def together(self, mine: dict[int, T]) -> dict[int, T]:
        """What all ranks have, on every rank."""
        if self._comm is None:
            return mine
        parts: list[dict[int, T]] = self._comm.allgather(mine)
        return {key: value for part in parts for key, value in part.items()}

    def in_order(self, mine: list[T]) -> list[T]:
        """The lists of all ranks one after the other, on the first rank; its own elsewhere."""
        if self._comm is None:
            return mine
        parts: list[list[T]] | None = self._comm.gather(mine)
        return mine if parts is None else [item for part in parts for item in part]

    def add_up(self, sums: Sums) -> None:
        """Add the sums of all ranks on the first one."""
        if self._comm is None:
            return
        from mpi4py import MPI

        names = {"moments": MPI.SUM, "rows": MPI.SUM, "low": MPI.MIN, "high": MPI.MAX}
        for name, operation in names.items():
            values = getattr(sums, name)
            if self.first:
                self._comm.Reduce(MPI.IN_PLACE, values, operation)
            else:
                self._comm.Reduce(values, None, operation)

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
