"""Phases of a run: their wall times, and what each rank takes in them."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

from carillon.command_line.progress import say
from carillon.processes.memory import peak_memory
from carillon.processes.mpi import MPI

START = "start"
"""Phase from the start of the process until its clock is made: imports, and the start of MPI."""
OTHER = "other"
"""Name under which seconds outside of all phases are told."""

ByRank = dict[str, dict[str, list[float]]]
"""By phase and figure, see `RankCost`, a number for each rank."""


@dataclass(frozen=True)
class RankCost:
    """Time and memory of one rank in a phase, or in several together."""

    seconds: float = 0.0
    """Wall time until all ranks were ready."""
    processor_seconds: float = 0.0
    """Processor time of all threads of the process until this rank was ready."""
    waiting_seconds: float = 0.0
    """Wall time from then on, until the last rank was ready."""
    peak_memory_bytes: int = 0
    """Largest resident memory of the process so far."""

    def __add__(self, other: RankCost) -> RankCost:
        return RankCost(
            self.seconds + other.seconds,
            self.processor_seconds + other.processor_seconds,
            self.waiting_seconds + other.waiting_seconds,
            max(self.peak_memory_bytes, other.peak_memory_bytes),
        )


class RankClock:
    """Time and memory of this rank by phase of a run; a phase within another is a part of that.

    Ranks meet at the end of each phase. A rank that waits for others within a phase takes wall time
    there, and processor time as far as its MPI polls.

    Examples
    --------
    >>> clock = RankClock(MPI.COMM_SELF)
    >>> with clock("assembly"):
    ...     with clock("mesh"):
    ...         pass
    >>> list(clock.by_rank())
    ['assembly', 'other']
    """

    def __init__(self, comm: MPI.Comm) -> None:
        self.costs: dict[str, RankCost] = {}
        self._comm = comm
        self._inside = False
        self._begin, self._processor = time.perf_counter(), time.process_time()

    @classmethod
    def of_process(cls, comm: MPI.Comm) -> RankClock:
        """A clock that began with the process; collective."""
        clock = cls(comm)
        clock._begin, clock._processor = time.perf_counter() - process_age(), 0.0
        clock._meet(START, clock._begin, clock._processor)
        return clock

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Count the body as part of phase `name`; nothing of it if it raises."""
        if self._inside:
            yield
            self._comm.barrier()
            return
        self._inside = True
        begin, processor = time.perf_counter(), time.process_time()
        try:
            yield
        finally:
            self._inside = False
        self._meet(name, begin, processor)

    def by_rank(self) -> ByRank:
        """Time and memory of all ranks by phase, on rank 0; empty on the others; collective."""
        phases = sum(self.costs.values(), RankCost())
        other = RankCost(
            max(time.perf_counter() - self._begin - phases.seconds, 0.0),
            max(time.process_time() - self._processor - phases.processor_seconds, 0.0),
            peak_memory_bytes=peak_memory(),
        )
        ranks = self._comm.gather({**self.costs, OTHER: other}) or []
        names = dict.fromkeys(name for rank in ranks for name in rank)
        return {
            name: {
                figure: [asdict(rank.get(name, RankCost()))[figure] for rank in ranks]
                for figure in asdict(RankCost())
            }
            for name in names
        }

    def _meet(self, name: str, begin: float, processor: float) -> None:
        """Wait for all ranks at the end of a phase that began at these readings."""
        ready, busy = time.perf_counter(), time.process_time()
        self._comm.barrier()
        end = time.perf_counter()
        self._processor += time.process_time() - busy  # it polls, and belongs to no phase
        cost = RankCost(end - begin, busy - processor, end - ready, peak_memory())
        self.costs[name] = self.costs.get(name, RankCost()) + cost


class Phases:
    """Adds up wall seconds by phase name; ranks are synchronised at the end of each phase.

    Parameters
    ----------
    comm
        The ranks.
    verbose
        Whether rank 0 tells each phase at its beginning and its end.
    clock
        Clock of the run that the phases belong to; one of their own if None.
    """

    def __init__(
        self, comm: MPI.Comm, verbose: bool = False, clock: RankClock | None = None
    ) -> None:
        self.seconds: dict[str, float] = {}
        self._clock = RankClock(comm) if clock is None else clock
        self._verbose = verbose and comm.rank == 0

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Time the body as part of phase `name`."""
        say(f"{name:<18s}      ...  ", visible=self._verbose, end="\r")
        begin = time.perf_counter()
        with self._clock(name):
            yield
        elapsed = time.perf_counter() - begin
        self.seconds[name] = self.seconds.get(name, 0.0) + elapsed
        say(f"{name:<18s} {elapsed:8.2f} s", visible=self._verbose)


def process_age() -> float:
    """Wall time [s] since this process was started, to a hundredth; 0 where only Linux tells."""
    try:
        fields = Path("/proc/self/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    started = int(fields[19]) / os.sysconf("SC_CLK_TCK")
    return max(time.clock_gettime(time.CLOCK_BOOTTIME) - started, 0.0)


def largest_peak_memory(comm: MPI.Comm) -> int:
    """Largest peak memory [bytes] of any rank so far; collective."""
    return int(comm.allreduce(peak_memory(), op=MPI.MAX))
