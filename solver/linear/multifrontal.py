"""Multifrontal factorisation of K - shift M, made for many right-hand sides at once.

Every front is eliminated by panels of its own rows (Duff & Reid 1983).  Of its diagonal block A
a panel keeps the root X of the inverse, A^-1 = X^T diag(s) X with signs s, and the product W of X
with what couples it to later rows.  A solve is then nothing but products of dense matrices; threads
share the branches of the tree, and the fronts above them.  Each panel pivots within itself, so the
matrix need not be definite.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from carillon.arrays import Array, Index
from carillon.errors import LocalConvergenceError
from carillon.numerics.simd import empty
from carillon.numerics.simd_width import LANES
from carillon.numerics.small_gemm import lanes_of
from carillon.processes import extras
from carillon.processes.memory import available_memory
from carillon.processes.threads import in_parallel, split
from solver.linear.elimination import eliminate_fronts
from solver.linear.plan import Plan
from solver.linear.sweeps import COUNTERS, down, up

COLUMNS = 64
"""Number of right-hand sides that go through the fronts together."""
FEWEST = 24
"""Least number of right-hand sides for each thread at which a thread takes its own through all
fronts."""


class Factor:
    """Factorisation of K - shift M for one material.

    Of its pivots `negative` are negative: so many eigenvalues are below the shift, by Sylvester's
    law of inertia. `rest` is the matrix that is left of the nodes that the plan keeps, packed (see
    `solver.linear.panels.packed_size`). Raises LocalConvergenceError if it would not fit in memory,
    or the shift is an eigenvalue to rounding.

    Parameters
    ----------
    plan
        Of the matrices' node graph.
    stiffness, mass
        (e, 3, 3) and (e,) blocks of K and M along the graph.
    shift
        Any value that is not an eigenvalue.
    dtype
        Precision: in single precision it takes half the time and memory, and is approximate.
    """

    exact = True

    def __init__(
        self,
        plan: Plan,
        stiffness: Array,
        mass: Array,
        shift: float,
        threads: int = 1,
        dtype: Any = np.float64,
    ) -> None:
        require_memory(3 * len(plan.position), plan.bytes * np.dtype(dtype).itemsize // 8)
        self._plan = plan
        self._threads = threads
        self.shift = shift
        self._pivots = np.empty(plan.pivot_offset[-1], dtype)
        self._coupling = np.empty(plan.coupling_offset[-1], dtype)
        self._signs = np.empty(plan.sign_offset[-1], dtype)
        kept = self._pivots, self._coupling, self._signs
        self.negative, self.rest = eliminate_fronts(
            plan, stiffness, mass, shift, threads, kept, dtype
        )

    def destroy(self) -> None:
        """Nothing but arrays to free."""

    def solve(self, vectors: Array) -> Array:
        """Solution (3 n, k) for a C-ordered block of right-hand sides (3 n, k)."""
        solution = np.empty_like(vectors)

        def solve(start: int, stop: int, threads: int) -> None:
            work = self._up(vectors, start, stop, threads)
            self._down(work, solution, start, stop, threads)

        self._in_columns(solve, vectors.shape[1])
        return solution

    def eliminate(self, vectors: Array) -> tuple[dict[int, Array], Array]:
        """First half of a solve: up the tree.

        Returns what `substitute` needs of it, and what the elimination adds to the right-hand sides
        of the nodes that the plan keeps (3 kept, k).
        """
        works: dict[int, Array] = {}
        added = np.zeros((3 * self._plan.kept, vectors.shape[1]))

        def climb(start: int, stop: int, threads: int) -> None:
            works[start] = self._up(vectors, start, stop, threads)
            added[:, start:stop] = self._kept_rows(works[start], stop - start)

        self._in_columns(climb, vectors.shape[1])
        return works, added

    def substitute(self, works: dict[int, Array], kept: Array, solution: Array) -> None:
        """Second half of a solve: down the tree, from the solution (3 kept, k) of the kept nodes.

        The rows of the others go to `solution` (3 n, k).
        """

        def descend(start: int, stop: int, threads: int) -> None:
            work = works.pop(start)
            self._kept_rows(work, stop - start)[:] = kept[:, start:stop]
            self._down(work, solution, start, stop, threads)

        self._in_columns(descend, kept.shape[1])

    def _kept_rows(self, work: Array, width: int) -> Array:
        """Rows of the kept nodes in a block, which come after all that are eliminated."""
        plan, size = self._plan, lanes_of(width) * LANES
        nodes = len(plan.fronts.order)
        return work.reshape(-1, size)[3 * (nodes - plan.kept) : 3 * nodes, :width]

    def _in_columns(self, work: Callable[[int, int, int], None], width: int) -> None:
        """Call `work` with ranges of columns and the number of threads for each.

        Threads share the ranges, or the fronts of one range after the other.
        """
        threads = self._threads
        sharing, each = (threads, 1) if width >= threads * FEWEST else (1, threads)
        ranges = split(width, sharing, COLUMNS)
        in_parallel(work, [(start, stop, each) for start, stop in ranges], sharing)

    def _up(self, vectors: Array, start: int, stop: int, threads: int) -> Array:
        """Forward sweep for the columns [start, stop): a block for `_down`."""
        shares, lanes = self._plan.shares(threads), lanes_of(stop - start)
        work = empty(3 * shares.rows * lanes)
        self._sweep(up, shares.up, (vectors, start, stop - start, work, lanes), threads)
        return work

    def _down(self, work: Array, solution: Array, start: int, stop: int, threads: int) -> None:
        """Inverse pivots, and backward sweep of a block of `_up`."""
        tickets, lanes = self._plan.shares(threads).down, lanes_of(stop - start)
        self._sweep(down, tickets, (solution, start, stop - start, work, lanes), threads)

    def _sweep(self, kernel: Any, tickets: Index, block: tuple[Any, ...], threads: int) -> None:
        plan, shares = self._plan, self._plan.shares(threads)
        counters = np.zeros(1 + COUNTERS * len(shares.ranges), dtype=np.int64)
        tree = shares.parts, shares.child_offset, shares.child, shares.taken_offset, shares.taken
        fronts = plan.fronts
        nodes = fronts.first, fronts.offset, fronts.order, shares.near, fronts.beyond
        pivots, coupling = (self._pivots, plan.pivot_offset), (self._coupling, plan.coupling_offset)
        factor = *pivots, *coupling, self._signs
        arguments = *block, counters, tickets, tree, nodes, factor
        in_parallel(kernel, [arguments] * threads, threads)


def require_memory(unknowns: int, needed: int) -> None:
    """Raise LocalConvergenceError unless so many bytes are free for a factorisation.

    The system lends memory that it has not got, and kills who uses it.
    """
    available = available_memory()
    if available is not None and needed > available:
        remedy = "use --linear-solver amg-cg, or more ranks on more machines"
        if not extras.is_installed(extras.PETSC):
            remedy = f"lower the resolution, or install PETSc, {extras.install()}"
        raise LocalConvergenceError(
            f"the sparse factorisation of {unknowns:,} unknowns takes about "
            f"{needed / 1e9:.1f} GB, {available / 1e9:.1f} GB are free; {remedy}"
        )
