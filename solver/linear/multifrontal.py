"""Multifrontal factorisation of K - shift M, made for many right-hand sides at once.

Every front is eliminated by panels of its own rows, which keep the inverse of their diagonal block
and its product W with what couples them to later rows (Duff & Reid 1983, with inverted pivots).  A
solve is then nothing but products of dense matrices; threads share the branches of the tree.  Each
panel pivots within itself, so the matrix need not be definite.
"""

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

    Of its eigenvalues `negative` are below the shift, by Sylvester's law of inertia. Raises
    LocalConvergenceError if it would not fit in memory.

    Parameters
    ----------
    plan
        Of the matrices' node graph.
    stiffness, mass
        (e, 3, 3) and (e,) blocks of K and M along the graph.
    shift
        Any value that is not an eigenvalue.
    """

    exact = True

    def __init__(
        self, plan: Plan, stiffness: Array, mass: Array, shift: float, threads: int = 1
    ) -> None:
        _require_memory(plan, plan.bytes)
        self._plan = plan
        self._threads = threads
        self.shift = shift
        self._pivots = np.empty(plan.pivot_offset[-1])
        self._coupling = np.empty(plan.coupling_offset[-1])
        kept = self._pivots, self._coupling
        self.negative = eliminate_fronts(plan, stiffness, mass, shift, threads, kept)

    def destroy(self) -> None:
        """Nothing but arrays to free."""

    def solve(self, vectors: Array) -> Array:
        """Solution (3 n, k) for a C-ordered block of right-hand sides (3 n, k)."""
        solution = np.empty_like(vectors)
        width, threads = vectors.shape[1], self._threads
        # Threads share the blocks of columns, or the fronts of one block after the other.
        sharing, each = (threads, 1) if width >= threads * FEWEST else (1, threads)

        def solve(start: int, stop: int) -> None:
            self._solve_columns(vectors, solution, start, stop, each)

        in_parallel(solve, split(width, sharing, COLUMNS), sharing)
        return solution

    def _solve_columns(
        self, vectors: Array, solution: Array, start: int, stop: int, threads: int
    ) -> None:
        """Solve for the columns [start, stop): up the tree of parts, and down again."""
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

        def down(number: int) -> None:
            part, work, above = tree.parts[number], works[number], tree.parent[number]
            if above >= 0:
                first = 3 * len(part.positions)
                copy_nodes(works[above], first, tree.inherited[number], lanes, work)
            self._sweep(substitute, part, work, lanes)
            put_rows(work, order[part.positions], lanes, solution, start, width)

        in_tree(up, tree.parent, threads)
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


def count_below(plan: Plan, stiffness: Array, mass: Array, value: float, threads: int = 1) -> int:
    """Number of eigenvalues below `value`, by a factorisation that is forgotten as it is made.

    The arguments and errors are those of `Factor`.
    """
    _require_memory(plan, plan.bytes_of_updates)
    return eliminate_fronts(plan, stiffness, mass, value, threads, None)


def _require_memory(plan: Plan, needed: int) -> None:
    """The system lends memory that it has not got, and kills who uses it."""
    available = available_memory()
    if available is not None and needed > available:
        raise LocalConvergenceError(
            f"the sparse factorisation of {3 * len(plan.position):,} unknowns takes about "
            f"{needed / 1e9:.1f} GB, {available / 1e9:.1f} GB are free; use --linear-solver "
            "amg-cg, or mumps on more ranks of more machines"
        )
