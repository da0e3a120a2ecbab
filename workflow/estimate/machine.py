"""The machine that is asked about, and how long jobs keep it."""

from __future__ import annotations

import heapq
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import groupby


@dataclass(frozen=True)
class Jobs:
    """Equal jobs.

    Attributes
    ----------
    count : how many there are.
    seconds : wall time of one of them.
    cores : cores that each is given, whether or not it can use them.
    memory_mb : its peak memory.
    ranks : MPI ranks that share its cores; those of several may lie on several nodes.
    """

    count: int
    seconds: float
    cores: int
    memory_mb: float
    ranks: int = 1

    @property
    def core_hours(self) -> float:
        """Core-hours of all."""
        return self.count * self.seconds * self.cores / 3600.0


@dataclass(frozen=True)
class Machine:
    """Equal nodes."""

    nodes: int
    cores_per_node: int

    @property
    def cores(self) -> int:
        """All cores."""
        return self.nodes * self.cores_per_node

    def granted(self, cores: int, ranks: int = 1) -> int:
        """Cores that a job asking for so many can get."""
        return min(cores, self.cores_per_node if ranks == 1 else self.cores)

    def slots(self, cores: int) -> int:
        """Jobs of so many cores each that run at a time."""
        if cores > self.cores_per_node:
            return max(1, self.cores // cores)
        return self.nodes * (self.cores_per_node // cores)

    def wall(self, jobs: Iterable[Jobs]) -> float:
        """Wall time [s] of independent jobs: the longest first, those of equal cores together.

        Examples
        --------
        >>> Machine(1, 4).wall([Jobs(1, 10.0, 2, 0.0), Jobs(2, 6.0, 2, 0.0), Jobs(1, 1.0, 4, 0.0)])
        13.0
        """
        ordered = sorted(jobs, key=lambda each: (each.cores, -each.seconds))
        return sum(self._wall(cores, same) for cores, same in groupby(ordered, lambda j: j.cores))

    def _wall(self, cores: int, jobs: Iterable[Jobs]) -> float:
        jobs = list(jobs)
        free = [0.0] * min(self.slots(cores), max(1, sum(each.count for each in jobs)))
        for each in jobs:
            for _ in range(each.count):
                heapq.heappush(free, heapq.heappop(free) + each.seconds)
        return max(free)
