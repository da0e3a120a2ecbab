"""Multifrontal factorisation of K - shift M, made for many right-hand sides at once.

Every front is eliminated by panels of its own rows, which keep the inverse of their diagonal block
and its product W with what couples them to later rows (Duff & Reid 1983, with inverted pivots).  A
solve is then nothing but products of dense matrices; threads share the branches of the tree.  Each
panel pivots within itself, so the matrix need not be definite.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.errors import LocalConvergenceError
from carillon.numerics.small_gemm import block, lanes_of
from carillon.processes.memory import available_memory
from carillon.processes.threads import in_parallel, in_tree, split
from solver.linear.elimination import eliminate_fronts
from solver.linear.plan import Part, Plan
from solver.linear.sweeps import add_nodes, copy_nodes, eliminate, put_rows, substitute, take_rows

COLUMNS = 64
"""Number of right-hand sides that go through the fronts together."""
FEWEST = 24
"""Least number of right-hand sides for each thread at which a thread takes its own through all
fronts."""


class Factor:
    """Factorisation of K - shift M for one material.

    Of its pivots `negative` are negative: so many eigenvalues are below the shift, by Sylvester's
    law of inertia. `rest` is the matrix that is left of the nodes that the plan keeps, packed (see
    `solver.linear.plan.packed_size`). Raises LocalConvergenceError if it would not fit in memory,
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
        kept = self._pivots, self._coupling
        self.negative, self.rest = eliminate_fronts(
            plan, stiffness, mass, shift, threads, kept, dtype
        )

    def destroy(self) -> None:
        """Nothing but arrays to free."""

    def solve(self, vectors: Array) -> Array:
        """Solution (3 n, k) for a C-ordered block of right-hand sides (3 n, k)."""
        solution = np.empty_like(vectors)

        def solve(start: int, stop: int, threads: int) -> None:
            works = self._up(vectors, start, stop, threads)
            self._down(works, solution, start, stop, threads)

        self._in_columns(solve, vectors.shape[1])
        return solution

    def eliminate(self, vectors: Array) -> tuple[dict[int, list[Array]], Array]:
        """First half of a solve: up the tree.

        Returns what `substitute` needs of it, and what the elimination adds to the right-hand sides
        of the nodes that the plan keeps (3 kept, k).
        """
        plan, works = self._plan, {}
        added = np.zeros((3 * plan.kept, vectors.shape[1]))

        def up(start: int, stop: int, threads: int) -> None:
            works[start] = self._up(vectors, start, stop, threads)
            work, part = works[start][-1], plan.shares(threads).parts[-1]
            lanes, kept = lanes_of(stop - start), np.arange(plan.kept)
            put_rows(
                work[3 * len(part.positions) * lanes :], kept, lanes, added, start, stop - start
            )

        self._in_columns(up, vectors.shape[1])
        return works, added

    def substitute(self, works: dict[int, list[Array]], kept: Array, solution: Array) -> None:
        """Second half of a solve: down the tree, from the solution (3 kept, k) of the kept nodes.

        The rows of the others go to `solution` (3 n, k).
        """
        plan = self._plan

        def down(start: int, stop: int, threads: int) -> None:
            work, part = works[start][-1], plan.shares(threads).parts[-1]
            lanes, nodes = lanes_of(stop - start), np.arange(plan.kept)
            rows = work[3 * len(part.positions) * lanes :]
            take_rows(kept, start, stop - start, nodes, lanes, rows)
            self._down(works.pop(start), solution, start, stop, threads)

        self._in_columns(down, kept.shape[1])

    def _in_columns(self, work: Callable[[int, int, int], None], width: int) -> None:
        """Call `work` with ranges of columns and the number of threads for each.

        Threads share the ranges, or the fronts of one range after the other.
        """
        threads = self._threads
        sharing, each = (threads, 1) if width >= threads * FEWEST else (1, threads)
        ranges = split(width, sharing, COLUMNS)
        in_parallel(work, [(start, stop, each) for start, stop in ranges], sharing)

    def _up(self, vectors: Array, start: int, stop: int, threads: int) -> list[Array]:
        """Forward sweep for the columns [start, stop), and the inverse pivots: a block a part."""
        tree, width = self._plan.shares(threads), stop - start
        order, lanes = self._plan.fronts.order, lanes_of(width)
        works: list[Array] = [np.empty(0)] * len(tree.parts)

        def up(number: int) -> None:
            part = tree.parts[number]
            work = block(3 * (len(part.positions) + len(part.beyond)), lanes)
            take_rows(vectors, start, width, order[part.positions], lanes, work)
            for child in tree.children[number]:
                first = 3 * len(tree.parts[child].positions)
                add_nodes(works[child], first, tree.inherited[child], lanes, work)
            self._sweep(eliminate, part, work, lanes)
            works[number] = work

        in_tree(up, tree.parent, threads)
        return works

    def _down(
        self, works: list[Array], solution: Array, start: int, stop: int, threads: int
    ) -> None:
        """Backward sweep of the blocks of `_up`."""
        tree, width = self._plan.shares(threads), stop - start
        order, lanes = self._plan.fronts.order, lanes_of(width)

        def down(number: int) -> None:
            part, work, above = tree.parts[number], works[number], tree.parent[number]
            if above >= 0:
                first = 3 * len(part.positions)
                copy_nodes(works[above], first, tree.inherited[number], lanes, work)
            self._sweep(substitute, part, work, lanes)
            put_rows(work, order[part.positions], lanes, solution, start, width)

        in_tree(down, tree.parent, threads, from_root=True)

    def _sweep(self, kernel: Any, part: Part, work: Array, lanes: int) -> None:
        plan = self._plan
        kernel(
            work,
            lanes,
            part.fronts,
            part.first,
            part.near,
            part.near_offset,
            self._pivots,
            plan.pivot_offset,
            self._coupling,
            plan.coupling_offset,
        )


def require_memory(unknowns: int, needed: int) -> None:
    """Raise LocalConvergenceError unless so many bytes are free for a factorisation.

    The system lends memory that it has not got, and kills who uses it.
    """
    available = available_memory()
    if available is not None and needed > available:
        raise LocalConvergenceError(
            f"the sparse factorisation of {unknowns:,} unknowns takes about "
            f"{needed / 1e9:.1f} GB, {available / 1e9:.1f} GB are free; use --linear-solver "
            "amg-cg, or more ranks on more machines"
        )
