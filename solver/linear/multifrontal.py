"""Multifrontal factorisation of K - shift M, made for many right-hand sides at once.

Every front is eliminated by panels of its own rows, which keep the inverse of their diagonal block
and its product W with what couples them to later rows (Duff & Reid 1983, with inverted pivots).  A
solve is then nothing but products of dense matrices; threads share the branches of the tree.  Each
panel pivots within itself, so the matrix need not be definite.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from carillon.errors import LocalConvergenceError
from carillon.narrow import block, lanes_of
from carillon.runtime import available_memory
from carillon.threads import in_parallel, in_tree, split
from solver.linear.plan import PANEL, Part, Plan
from solver.linear.sweeps import (
    STRIP,
    add_nodes,
    copy_nodes,
    eliminate,
    put_rows,
    substitute,
    take_rows,
)

Array = NDArray[np.float64]

COLUMNS = 64
"""Right-hand sides that are carried through the fronts together."""


class Factor:
    """Factorisation of K - shift M for one material.

    Parameters
    ----------
    plan
        Of the matrices' node graph.
    stiffness, mass
        (e, 3, 3) and (e,) blocks of K and M along the graph.
    shift
        Any value that is not an eigenvalue.
    threads
        Threads that share the work.

    Attributes
    ----------
    negative
        Number of eigenvalues below the shift, by Sylvester's law of inertia.

    Raises
    ------
    LocalConvergenceError
        If it would not fit in memory.
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
        self.negative = _eliminate(plan, stiffness, mass, shift, threads, kept)

    def destroy(self) -> None:
        """Nothing but arrays to free."""

    def solve(self, vectors: Array) -> Array:
        """Solution (3 n, k) for a C-ordered block of right-hand sides (3 n, k)."""
        solution = np.empty_like(vectors)
        for start, stop in split(vectors.shape[1], 1, COLUMNS):
            self._solve_columns(vectors, solution, start, stop)
        return solution

    def _solve_columns(self, vectors: Array, solution: Array, start: int, stop: int) -> None:
        """Solve for the columns [start, stop): up the tree of parts, and down again."""
        tree, width = self._plan.shares(self._threads), stop - start
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

        in_tree(up, tree.parent, self._threads)
        in_tree(down, tree.parent, self._threads, from_root=True)

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
    return _eliminate(plan, stiffness, mass, value, threads, None)


def _require_memory(plan: Plan, needed: int) -> None:
    """The system lends memory that it has not got, and kills who uses it."""
    available = available_memory()
    if available is not None and needed > available:
        raise LocalConvergenceError(
            f"the sparse factorisation of {3 * len(plan.position):,} unknowns takes about "
            f"{needed / 1e9:.1f} GB, {available / 1e9:.1f} GB are free; use --linear-solver "
            "amg-cg, or mumps on more ranks of more machines"
        )


def _eliminate(
    plan: Plan,
    stiffness: Array,
    mass: Array,
    shift: float,
    threads: int,
    kept: tuple[Array, Array] | None,
) -> int:
    """Eliminate all fronts, and count the negative eigenvalues of their pivots.

    What a solve needs goes to `kept`: pivots with what couples panels, and W in strips.
    """
    updates: dict[int, Array] = {}
    first = plan.fronts.first

    def eliminated(front: int, threads: int = 1) -> int:
        n = 3 * int(first[front + 1] - first[front])
        b = 3 * len(plan.fronts.boundary[front])
        own = np.zeros((n, n + b))
        _add_entries(own, plan.entries[front], stiffness, mass, shift)
        # A piece that nothing connects to the rest has no update.
        children = [child for child in plan.children[front] if child in updates]
        for child in children:
            _subtract_from_own(own, plan.places[child], updates[child])
        pivots = None
        if kept is not None:
            pivots = kept[0][plan.pivot_offset[front] : plan.pivot_offset[front + 1]]
        scaled, negative = _eliminate_panels(own, pivots)
        if kept is not None:
            coupling = kept[1][plan.coupling_offset[front] : plan.coupling_offset[front + 1]]
            for strip in range(0, b, STRIP):
                few = min(STRIP, b - strip)
                part = coupling[n * strip : n * (strip + few)].reshape(n, few)
                part[:] = scaled[:, n + strip : n + strip + few]
        if b:
            update = _product(own[:, n:], scaled[:, n:], threads)
            for child in children:
                _add_beyond(update, n // 3, plan.places[child], updates.pop(child))
            updates[front] = update
        return negative

    def eliminated_part(part: Part) -> int:
        return sum(eliminated(int(front)) for front in part.fronts)

    # The fronts above the branches are few and large: threads share each of them.
    tree = plan.shares(threads)
    branches = [(part,) for part, below in zip(tree.parts, tree.children, strict=True) if not below]
    negative = sum(in_parallel(eliminated_part, branches, threads))
    for part, below in zip(tree.parts, tree.children, strict=True):
        if below:
            negative += eliminated(int(part.fronts[0]), threads)
    return negative


def _eliminate_panels(own: Array, pivots: Array | None) -> tuple[Array, int]:
    """Eliminate the own rows of a front, a panel of them at a time.

    Parameters
    ----------
    own
        (n, n + b) own rows of the matrix, of which the upper triangle counts; on return those of
        the matrix from which the panels before were eliminated.
    pivots
        What becomes of each panel's own columns: the inverse of its diagonal block, and the product
        with it of what couples the panel to the panels after.

    Returns
    -------
    tuple[Array, int]
        (n, n + b) these products, for the rows beyond too, and the number of negative eigenvalues
        of the diagonal blocks.
    """
    n = len(own)
    scaled = np.empty_like(own)
    negative = place = 0
    for start, stop in split(n, 1, PANEL):
        rows = own[start:stop, start:]
        if start:
            rows -= own[:start, start:stop].T @ scaled[:start, start:]
        size = stop - start
        inverse, below = _inverse(rows[:, :size])
        negative += below
        np.matmul(inverse, rows[:, size:], out=scaled[start:stop, stop:])
        if pivots is None:
            continue
        for part in (inverse, scaled[start:stop, stop:n]):
            pivots[place : place + part.size].reshape(part.shape)[:] = part
            place += part.size
    return scaled, negative


def _inverse(block: Array) -> tuple[Array, int]:
    """Inverse of a symmetric matrix, given its upper triangle, and its negative eigenvalues."""
    factor, pivots, _ = la.lapack.dsytrf(np.array(block).T, lower=1, overwrite_a=1)
    # Every 2x2 pivot of Bunch and Kaufman has one eigenvalue of either sign.
    single = pivots > 0
    negative = int((np.diag(factor)[single] < 0.0).sum() + (~single).sum() // 2)
    inverse, failed = la.lapack.dsytri(factor, pivots, lower=1, overwrite_a=1)
    if failed:
        raise LocalConvergenceError("the shifted matrix is singular to rounding; change the shift")
    result = inverse.T
    _mirror(result)
    return result, negative


def _product(left: Array, right: Array, threads: int) -> Array:
    """The upper triangle of left^T right, which is symmetric; below it anything."""
    size = left.shape[1]
    product = np.empty((size, size))

    def panel(start: int, stop: int) -> None:
        np.matmul(left[:, start:stop].T, right[:, start:], out=product[start:stop, start:])

    in_parallel(panel, split(size, 1, PANEL), threads)
    return product


@numba.njit(cache=True, nogil=True)
def _add_entries(matrix, entries, stiffness, mass, shift):  # type: ignore[no-untyped-def]
    for entry in range(entries.shape[0]):
        row, column, number = 3 * entries[entry, 0], 3 * entries[entry, 1], entries[entry, 2]
        for i in range(3):
            for j in range(3):
                matrix[row + i, column + j] += stiffness[number, i, j]
            matrix[row + i, column + i] -= shift * mass[number]


@numba.njit(cache=True, nogil=True)
def _subtract_from_own(own, places, update):  # type: ignore[no-untyped-def]
    count = own.shape[0] // 3
    for a in range(len(places)):
        if places[a] >= count:
            break
        for i in range(3):
            target = own[3 * places[a] + i]
            source = update[3 * a + i]
            for b in range(a, len(places)):
                for j in range(3):
                    target[3 * places[b] + j] -= source[3 * b + j]


@numba.njit(cache=True, nogil=True)
def _add_beyond(total, count, places, update):  # type: ignore[no-untyped-def]
    for a in range(len(places)):
        if places[a] < count:
            continue
        for i in range(3):
            target = total[3 * (places[a] - count) + i]
            source = update[3 * a + i]
            for b in range(a, len(places)):
                for j in range(3):
                    target[3 * (places[b] - count) + j] += source[3 * b + j]


@numba.njit(cache=True, nogil=True)
def _mirror(matrix):  # type: ignore[no-untyped-def]
    """The upper triangle becomes the lower one too."""
    for row in range(len(matrix)):
        for column in range(row):
            matrix[row, column] = matrix[column, row]
