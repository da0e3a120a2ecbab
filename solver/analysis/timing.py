"""Wall time by phase, the slowest rank's."""

from __future__ import annotations

import resource
import time
from collections.abc import Iterator
from contextlib import contextmanager

from mpi4py import MPI

from carillon.command_line.progress import say


class Phases:
    """Adds up wall seconds by phase name; ranks are synchronised at the end of each phase."""

    def __init__(self, comm: MPI.Comm, verbose: bool = False) -> None:
        self.seconds: dict[str, float] = {}
        self._comm = comm
        self._verbose = verbose and comm.rank == 0

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Time the body as part of phase `name`."""
        say(f"{name:<18s}      ...  ", visible=self._verbose, end="\r")
        begin = time.perf_counter()
        yield
        self._comm.barrier()
        elapsed = time.perf_counter() - begin
        self.seconds[name] = self.seconds.get(name, 0.0) + elapsed
        say(f"{name:<18s} {elapsed:8.2f} s", visible=self._verbose)


def peak_memory(comm: MPI.Comm) -> int:
    """Largest peak memory [bytes] of any rank so far."""
    local = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    return int(comm.allreduce(local, op=MPI.MAX))
