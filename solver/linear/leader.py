"""One rank of a machine factorises for all of them, with their cores, while they sleep.

The multifrontal factorisation is shared by threads, which need no messages; the ranks of a machine
have the same memory. Right-hand sides travel to the first rank and solutions back.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from carillon.processes.threads import blas_threads
from solver.distribution.collective import compute_on_root, gather_rows
from solver.linear.multifrontal import Factor, count_below
from solver.linear.plan import Plan

if TYPE_CHECKING:
    from solver.assembly.system import Layout, System
    from solver.linear import Inverse

Number = TypeVar("Number", np.float64, np.int64)
T = TypeVar("T")

NAP, SHORTEST_NAP = 0.03, 1e-4
"""Time that a waiting rank sleeps between two looks, which take some from those at work: as a share
of that waited so far, and the least [s]."""


class Leader:
    """Rank 0's part of the work for the ranks of its machine; collective."""

    def __init__(self, layout: Layout) -> None:
        self.comm = comm = layout.comm
        self._cores = set[int]().union(*comm.allgather(os.sched_getaffinity(0)))
        local_mesh, pattern = layout.local_mesh, layout.pattern
        self._unknowns = comm.gather(3 * (pattern.stop - pattern.start))
        lattice = self.collected(local_mesh.lattice())
        counts = self.collected(np.diff(pattern.indptr)[:, None])
        columns = self.collected(pattern.global_columns[:, None])

        def planned() -> Plan:
            indptr = np.concatenate([[0], np.cumsum(counts)])
            steps = local_mesh.cells.elements.steps
            return Plan(lattice, indptr, columns.ravel(), steps=steps)

        # Of all rows, on rank 0 alone.
        self.whole_plan = cast(Plan, self.alone(planned))

    def threads(self, system: System) -> int:
        """Threads that rank 0 has while it works for all."""
        return min(len(self._cores), self.comm.size * system.rows.threads)

    def alone(self, compute: Callable[[], T], threads: int = 1) -> T | None:
        """Call `compute` on rank 0, which may use all cores and keeps the result.

        BLAS has so many `threads` within. An exception is raised on every rank.
        """
        if self.comm.size == 1:
            return compute()

        def awake() -> T:
            try:
                with _on_cores(self._cores), blas_threads(threads):
                    return compute()
            finally:
                self.comm.Ibarrier().Wait()

        if self.comm.rank:
            arrived, begin = self.comm.Ibarrier(), time.monotonic()
            while not arrived.Test():
                time.sleep(max(SHORTEST_NAP, NAP * (time.monotonic() - begin)))
        return compute_on_root(self.comm, awake)

    def inverse(self, system: System, shift: float) -> Inverse:
        """(K - shift M)^-1 by a factor on rank 0."""
        matrices, threads = self._matrices(system), self.threads(system)

        def factor() -> Factor:
            return Factor(self.whole_plan, *matrices, shift, threads)

        made = self.alone(factor, threads)
        return made if made is not None and self.comm.size == 1 else _LedInverse(self, shift, made)

    def count_below(self, system: System, value: float) -> int:
        """Eigenvalues of K - value M below zero, by inertia."""
        matrices, threads = self._matrices(system), self.threads(system)

        def count() -> int:
            return count_below(self.whole_plan, *matrices, value, threads)

        return self.comm.bcast(self.alone(count, threads))

    def _matrices(self, system: System) -> tuple[Array, Array]:
        """All entries of K and M along the graph on rank 0; nothing elsewhere."""
        rows = system.rows
        stiffness = self.collected(rows.stiffness.reshape(-1, 9))
        mass = self.collected(rows.mass[:, None])
        return stiffness.reshape(-1, 3, 3), mass.ravel()

    def collected(self, part: NDArray[Number]) -> NDArray[Number]:
        """Rows of all ranks on rank 0; nothing elsewhere."""
        if self.comm.size == 1:
            return part
        whole = gather_rows(self.comm, np.ascontiguousarray(part))
        return part[:0] if whole is None else whole

    def handed_out(self, whole: Array | None, like: Array) -> Array:
        """Every rank's rows of what rank 0 has."""
        part, sent = np.empty_like(like), None
        if whole is not None:
            sent = whole, [like.shape[1] * each for each in cast(list[int], self._unknowns)]
        self.comm.Scatterv(sent, part)
        return part


class _LedInverse:
    """Action of (K - shift M)^-1 by the factor that rank 0 has; see `solver.linear.Inverse`."""

    exact = True

    def __init__(self, leader: Leader, shift: float, factor: Factor | None) -> None:
        self.shift = shift
        self._leader, self._factor = leader, factor
        self.negative = leader.comm.bcast(None if factor is None else factor.negative)

    def solve(self, block: Array) -> Array:
        """Solutions for a row-major block of right-hand sides (local unknowns, k); collective."""
        whole = self._leader.collected(block)
        solution = self._leader.alone(lambda: cast(Factor, self._factor).solve(whole))
        return self._leader.handed_out(solution, block)

    def destroy(self) -> None:
        """Forget the factor."""
        self._factor = None


@contextmanager
def _on_cores(cores: set[int]) -> Iterator[None]:
    before = os.sched_getaffinity(0)
    with suppress(OSError):
        os.sched_setaffinity(0, cores)
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)
