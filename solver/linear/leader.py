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

from carillon.runtime import allowed_threads
from carillon.threads import blas_threads
from solver.distribution.collective import compute_on_root
from solver.linear.multifrontal import Factor, count_below
from solver.linear.plan import Plan

if TYPE_CHECKING:
    from solver.assembly.system import Layout, System
    from solver.linear import Inverse

Array = NDArray[np.float64]
Number = TypeVar("Number", np.float64, np.int64)
T = TypeVar("T")

NAP, SHORTEST_NAP = 0.03, 1e-4
"""Time that a waiting rank sleeps between two looks, which take some from those at work: as a share
of that waited so far, and the least [s]."""


class Leader:
    """Rank 0's part of the work for the ranks of its machine; collective.

    Parameters
    ----------
    layout
        Of the mesh.

    Attributes
    ----------
    plan
        Elimination of all rows, on rank 0 alone.
    """

    def __init__(self, layout: Layout) -> None:
        self.comm = comm = layout.comm
        self._rows = comm.gather(layout.pattern.stop - layout.pattern.start)
        self._entries = comm.gather(len(layout.pattern.columns))
        everyone = comm.allgather((os.sched_getaffinity(0), allowed_threads()))
        self._cores = set().union(*(cores for cores, _ in everyone))
        self.threads = min(len(self._cores), sum(threads for _, threads in everyone))
        local_mesh, pattern = layout.local_mesh, layout.pattern
        lattice = self._collected(local_mesh.lattice(), self._rows)
        counts = self._collected(np.diff(pattern.indptr)[:, None], self._rows)
        columns = self._collected(pattern.global_columns[:, None], self._entries)

        def planned() -> Plan:
            indptr = np.concatenate([[0], np.cumsum(cast(NDArray[np.int64], counts))])
            steps = local_mesh.cells.elements.steps
            return Plan(lattice, indptr, columns.ravel(), steps=steps)

        self.plan = self.alone(planned)

    def alone(self, compute: Callable[[], T]) -> T | None:
        """Call `compute` on rank 0, which may use all cores and keeps the result.

        Its exception is raised on every rank.
        """
        if self.comm.size == 1:
            return compute()

        def awake() -> T:
            try:
                with _on_cores(self._cores), blas_threads(self.threads):
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
        matrices = self._matrices(system)

        def factor() -> Factor:
            return Factor(cast(Plan, self.plan), *matrices, shift, self.threads)

        made = self.alone(factor)
        return made if made is not None and self.comm.size == 1 else _LedInverse(self, shift, made)

    def count_below(self, system: System, value: float) -> int:
        """Eigenvalues of K - value M below zero, by inertia."""
        stiffness, mass = self._matrices(system)

        def count() -> int:
            return count_below(cast(Plan, self.plan), stiffness, mass, value, self.threads)

        return self.comm.bcast(self.alone(count))

    def _matrices(self, system: System) -> tuple[Array, Array]:
        """All entries of K and M along the graph on rank 0; nothing elsewhere."""
        rows = system.rows
        stiffness = self._collected(rows.stiffness.reshape(-1, 9), self._entries)
        mass = self._collected(rows.mass[:, None], self._entries)
        return stiffness.reshape(-1, 3, 3), mass.ravel()

    def collected(self, block: Array) -> Array:
        """All rows (n, k) of a block on rank 0; nothing elsewhere."""
        by_node = self._collected(block.reshape(len(block) // 3, -1), self._rows)
        return by_node.reshape(-1, block.shape[1])

    def handed_out(self, whole: Array | None, like: Array) -> Array:
        """Every rank's rows of what rank 0 has."""
        part = np.empty_like(like)
        sent = None
        if whole is not None:
            sent = whole, _sizes(self._rows, 3 * like.shape[1])
        self.comm.Scatterv(sent, part)
        return part

    def _collected(self, part: NDArray[Number], rows: list[int] | None) -> NDArray[Number]:
        part = np.ascontiguousarray(part)
        if self.comm.size == 1:
            return part
        if rows is None:
            self.comm.Gatherv(part, None)
            return part[:0]
        whole = np.empty((sum(rows), part.shape[1]), dtype=part.dtype)
        self.comm.Gatherv(part, (whole, _sizes(rows, part.shape[1])))
        return whole


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
        found = self._leader.alone(lambda: cast(Factor, self._factor).solve(whole))
        return self._leader.handed_out(found, block)

    def destroy(self) -> None:
        """Forget the factor."""
        self._factor = None


def _sizes(rows: list[int] | None, width: int) -> list[int]:
    return [width * each for each in rows or []]


@contextmanager
def _on_cores(cores: set[int]) -> Iterator[None]:
    """Let this thread, and those that it starts, use these cores where the system allows it."""
    before = os.sched_getaffinity(0)
    with suppress(OSError):
        os.sched_setaffinity(0, cores)
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)
