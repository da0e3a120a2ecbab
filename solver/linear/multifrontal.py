"""Multifrontal factorisation of K - shift M, made for many right-hand sides at once.

Every front keeps the inverse of its own block and its product W with the coupling to what is
eliminated later (Duff & Reid 1983, with inverted pivots).  A solve is then nothing but products of
dense matrices; threads share the branches of the tree.  Each front pivots within itself, so the
matrix need not be definite.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.errors import LocalConvergenceError
from carillon.runtime import available_memory
from carillon.threads import in_parallel, split
from solver.linear.dissection import Fronts, dissect

Array = NDArray[np.float64]
Index = NDArray[np.int64]

COLUMNS = 128
"""Right-hand sides that are carried through the fronts together."""
BRANCHES = 3
"""Branches for each thread, at least: their work is not equal."""
UPDATES_FRACTION = 1.3
"""Memory at its peak, when updates wait for their parents, as a share of what the factor takes."""
PANEL = 192
"""Columns of a symmetric product that are formed together."""


@dataclass(frozen=True)
class Part:
    """Some fronts with the rows that they eliminate, and those beyond that they are coupled to.

    Attributes
    ----------
    fronts
        Their numbers, ascending.
    positions, beyond
        Positions in the elimination order of the part's own rows and of the rows beyond, ascending.
    first
        (fronts + 1,) first own row of each front, one a node.
    near, near_offset
        Rows that each front is coupled to, in compressed form: own rows, then rows beyond.
    """

    fronts: Index
    positions: Index
    beyond: Index
    first: Index
    near: Index
    near_offset: Index

    @classmethod
    def of_fronts(cls, whole: Fronts, fronts: Index) -> Part:
        """Part of these fronts, which holds all that lies between any of them in the tree."""
        none = np.empty(0, dtype=np.int64)
        starts, stops = whole.first[fronts], whole.first[fronts + 1]
        positions = np.concatenate([none, *map(np.arange, starts, stops)])
        boundary = [whole.boundary[front] for front in fronts]
        near = np.concatenate([none, *boundary])
        beyond = np.setdiff1d(near, positions)
        # Outside the part all rows come later than the own ones that are coupled to them.
        place = np.searchsorted(positions, near)
        own = positions[np.minimum(place, len(positions) - 1)] == near if len(near) else none > 0
        local = np.where(own, place, len(positions) + np.searchsorted(beyond, near))
        counts = np.array([len(rows) for rows in boundary], dtype=np.int64)
        return cls(
            fronts,
            positions,
            beyond,
            np.concatenate([[0], np.cumsum(stops - starts)]),
            local,
            np.concatenate([[0], np.cumsum(counts)]),
        )


@dataclass(frozen=True)
class Shares:
    """Branches of the tree, which threads work on beside each other, and the fronts above them."""

    branches: list[Part]
    top: Part


class Plan:
    """What a factorisation needs to know of the sparsity alone: made once, used for any material.

    Parameters
    ----------
    lattice
        (n, 3) integer coordinates of the nodes.
    indptr, indices
        Node graph in compressed rows; the data of `Factor` follow it.
    options
        Others of `solver.linear.dissection.dissect`.
    """

    def __init__(self, lattice: Index, indptr: Index, indices: Index, **options: Any) -> None:
        self.fronts: Fronts = dissect(lattice, indptr, indices, **options)
        fronts = self.fronts
        self.position = fronts.position
        self.children = fronts.children()
        self.entries = fronts.entries(indptr, indices)
        self.places = fronts.places()
        own = 3 * np.diff(fronts.first)
        outside = 3 * np.array([len(boundary) for boundary in fronts.boundary])
        self.inverse_offset = np.concatenate([[0], np.cumsum(own**2)])
        self.coupling_offset = np.concatenate([[0], np.cumsum(own * outside)])
        self.bytes = int(
            UPDATES_FRACTION * 8 * (self.inverse_offset[-1] + self.coupling_offset[-1])
        )
        self._work = 2 * own**2 + 4 * own * outside
        self._shares: dict[int, Shares] = {}

    def shares(self, threads: int) -> Shares:
        """How the fronts are shared among threads; made once for each number of them."""
        if threads not in self._shares:
            branches = self._branches(threads)
            inside = np.concatenate([np.arange(*branch) for branch in branches])
            top = np.setdiff1d(np.arange(len(self.fronts)), inside)
            self._shares[threads] = Shares(
                [Part.of_fronts(self.fronts, np.arange(*branch)) for branch in branches],
                Part.of_fronts(self.fronts, top),
            )
        return self._shares[threads]

    def _branches(self, threads: int) -> list[tuple[int, int]]:
        """Half-open ranges of fronts, whole branches of the tree, that threads take in turn.

        The largest come first.
        """
        parent = self.fronts.parent
        work = self._work.astype(float)
        size = np.ones(len(parent), dtype=np.int64)
        for front, above in enumerate(parent):
            if above >= 0:
                work[above] += work[front]
                size[above] += size[front]
        chosen = [int(front) for front in np.flatnonzero(parent < 0)]
        if threads > 1:
            largest = work[chosen].sum() / (BRANCHES * threads)
            while True:
                big = max(chosen, key=lambda front: work[front])
                if work[big] <= largest or not self.children[big]:
                    break
                chosen.remove(big)
                chosen += self.children[big]
        chosen.sort(key=lambda front: -work[front])
        return [(front + 1 - int(size[front]), front + 1) for front in chosen]


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

    Raises
    ------
    LocalConvergenceError
        If it would not fit in memory.
    """

    exact = True
    lasting = True

    def __init__(
        self, plan: Plan, stiffness: Array, mass: Array, shift: float, threads: int = 1
    ) -> None:
        self._plan = plan
        self._threads = threads
        self.shift = shift
        _require_memory(plan)
        self._inverse = np.empty(plan.inverse_offset[-1])
        self._coupling = np.empty(plan.coupling_offset[-1])
        self._factor(stiffness, mass)

    def destroy(self) -> None:
        """Nothing but arrays to free."""

    def _factor(self, stiffness: Array, mass: Array) -> None:
        plan = self._plan
        update: dict[int, Array] = {}
        first = plan.fronts.first

        def eliminate(front: int) -> None:
            n = 3 * int(first[front + 1] - first[front])
            b = 3 * len(plan.fronts.boundary[front])
            inverse = self._inverse[plan.inverse_offset[front] : plan.inverse_offset[front + 1]]
            coupling = self._coupling[plan.coupling_offset[front] : plan.coupling_offset[front + 1]]
            matrix = np.zeros((n + b, n + b))
            _add_entries(matrix, plan.entries[front], stiffness, mass, self.shift)
            for child in plan.children[front]:
                # A piece that nothing connects to the rest has no update.
                if child in update:
                    _add_update(matrix, plan.places[child], update.pop(child))
            own = np.ascontiguousarray(matrix[:n, :n])
            inverse.reshape(n, n)[:] = np.linalg.inv(own)
            if n and b:
                outside = np.ascontiguousarray(matrix[:n, n:])
                product = np.dot(inverse.reshape(n, n), outside, out=coupling.reshape(n, b))
                rest = np.ascontiguousarray(matrix[n:, n:])
                _subtract_symmetric(rest, outside, product)
                update[front] = rest
            elif b:
                update[front] = matrix

        def eliminate_all(part: Part) -> None:
            for front in part.fronts:
                eliminate(int(front))

        shares = plan.shares(self._threads)
        in_parallel(eliminate_all, [(part,) for part in shares.branches], self._threads)
        eliminate_all(shares.top)

    def solve(self, block: Array) -> Array:
        """Solution (3 n, k) for a C-ordered block of right-hand sides (3 n, k)."""
        solution = np.empty_like(block)
        for start, stop in split(block.shape[1], 1, COLUMNS):
            self._solve_columns(block, solution, start, stop)
        return solution

    def _solve_columns(self, block: Array, solution: Array, start: int, stop: int) -> None:
        """Solve for the columns [start, stop): up the branches, through the top, down again."""
        plan, threads = self._plan, self._threads
        shares = plan.shares(threads)
        order = plan.fronts.order
        top = shares.top

        def taken(part: Part) -> Array:
            work = np.zeros((3 * (len(part.positions) + len(part.beyond)), stop - start))
            _take_rows(block, start, order[part.positions], work)
            return work

        def up(part: Part) -> Array:
            work = taken(part)
            self._sweep(_eliminate, part, work)
            return work

        def down(part: Part, work: Array) -> None:
            if len(part.beyond):
                rows = np.searchsorted(top.positions, part.beyond)
                _take_rows(above, 0, rows, work[3 * len(part.positions) :])
            self._sweep(_substitute, part, work)
            _put_rows(work, order[part.positions], solution, start)

        works = in_parallel(up, [(part,) for part in shares.branches], threads)
        above = taken(top)
        if len(top.fronts):
            for part, work in zip(shares.branches, works, strict=True):
                rows = np.searchsorted(top.positions, part.beyond)
                _add_rows(work[3 * len(part.positions) :], rows, above)

            self._sweep(_eliminate, top, above)
            self._sweep(_substitute, top, above)
            _put_rows(above, order[top.positions], solution, start)
        in_parallel(down, list(zip(shares.branches, works, strict=True)), threads)

    def _sweep(self, kernel: Any, part: Part, work: Array) -> None:
        plan = self._plan
        kernel(
            work,
            part.fronts,
            part.first,
            part.near,
            part.near_offset,
            self._inverse,
            plan.inverse_offset,
            self._coupling,
            plan.coupling_offset,
        )


def _require_memory(plan: Plan) -> None:
    """The system lends memory that it has not got, and kills who uses it."""
    available = available_memory()
    if available is not None and plan.bytes > available:
        raise LocalConvergenceError(
            f"the sparse factorisation of {3 * len(plan.position):,} unknowns takes about "
            f"{plan.bytes / 1e9:.1f} GB, {available / 1e9:.1f} GB are free; use --linear-solver "
            "amg-cg, or mumps on more ranks of more machines"
        )


def _subtract_symmetric(matrix: Array, left: Array, right: Array) -> None:
    """Subtract left^T right from a matrix, both symmetric; one half is mirrored."""
    size = len(matrix)
    for start in range(0, size, PANEL):
        stop = min(start + PANEL, size)
        matrix[start:, start:stop] -= left[:, start:].T @ right[:, start:stop]
    if size > PANEL:
        _mirror(matrix, PANEL)


@numba.njit(cache=True, nogil=True)
def _add_entries(matrix, entries, stiffness, mass, shift):  # type: ignore[no-untyped-def]
    for entry in range(entries.shape[0]):
        row, column, number = 3 * entries[entry, 0], 3 * entries[entry, 1], entries[entry, 2]
        for i in range(3):
            for j in range(3):
                matrix[row + i, column + j] += stiffness[number, i, j]
            matrix[row + i, column + i] -= shift * mass[number]


@numba.njit(cache=True, nogil=True)
def _add_update(matrix, places, update):  # type: ignore[no-untyped-def]
    for a in range(len(places)):
        for i in range(3):
            target = matrix[3 * places[a] + i]
            source = update[3 * a + i]
            for b in range(len(places)):
                column = 3 * places[b]
                target[column] += source[3 * b]
                target[column + 1] += source[3 * b + 1]
                target[column + 2] += source[3 * b + 2]


@numba.njit(cache=True, nogil=True)
def _mirror(matrix, panel):  # type: ignore[no-untyped-def]
    size = len(matrix)
    for start in range(0, size, panel):
        for row in range(start + panel, size):
            for column in range(start, start + panel):
                matrix[column, row] = matrix[row, column]


@numba.njit(cache=True, nogil=True)
def _take_rows(block, start, nodes, work):  # type: ignore[no-untyped-def]
    width = work.shape[1]
    for a in range(len(nodes)):
        for i in range(3):
            work[3 * a + i] = block[3 * nodes[a] + i, start : start + width]


@numba.njit(cache=True, nogil=True)
def _put_rows(work, nodes, block, start):  # type: ignore[no-untyped-def]
    width = work.shape[1]
    for a in range(len(nodes)):
        for i in range(3):
            block[3 * nodes[a] + i, start : start + width] = work[3 * a + i]


@numba.njit(cache=True, nogil=True)
def _add_rows(rows, places, total):  # type: ignore[no-untyped-def]
    for a in range(len(places)):
        for i in range(3):
            total[3 * places[a] + i] += rows[3 * a + i]


@numba.njit(cache=True, nogil=True)
def _scratch(first, near_offset, width):  # type: ignore[no-untyped-def]
    """Room for the own rows of the tallest front, and for those that the widest is coupled to."""
    tallest = longest = 0
    for number in range(len(first) - 1):
        tallest = max(tallest, 3 * (first[number + 1] - first[number]))
        longest = max(longest, 3 * (near_offset[number + 1] - near_offset[number]))
    return np.empty((tallest, width)), np.empty((longest, width))


@numba.njit(cache=True, nogil=True)
def _eliminate(  # type: ignore[no-untyped-def]
    work, fronts, first, near, near_offset, inverse, inverse_offset, coupling, coupling_offset
):
    inside, outside = _scratch(first, near_offset, work.shape[1])
    for number in range(len(fronts)):
        front = fronts[number]
        n = 3 * (first[number + 1] - first[number])
        if n == 0:
            continue
        own = work[3 * first[number] : 3 * first[number + 1]]
        pivot = inverse[inverse_offset[front] : inverse_offset[front + 1]].reshape(n, n)
        rows = near[near_offset[number] : near_offset[number + 1]]
        b = 3 * len(rows)
        if b:
            W = coupling[coupling_offset[front] : coupling_offset[front + 1]].reshape(n, b)
            np.dot(W.T, own, outside[:b])
            for a in range(len(rows)):
                for i in range(3):
                    work[3 * rows[a] + i] -= outside[3 * a + i]
        np.dot(pivot, own, inside[:n])
        own[:] = inside[:n]


@numba.njit(cache=True, nogil=True)
def _substitute(  # type: ignore[no-untyped-def]
    work, fronts, first, near, near_offset, inverse, inverse_offset, coupling, coupling_offset
):
    inside, outside = _scratch(first, near_offset, work.shape[1])
    for number in range(len(fronts) - 1, -1, -1):
        front = fronts[number]
        rows = near[near_offset[number] : near_offset[number + 1]]
        b = 3 * len(rows)
        n = 3 * (first[number + 1] - first[number])
        if n and b:
            W = coupling[coupling_offset[front] : coupling_offset[front + 1]].reshape(n, b)
            for a in range(len(rows)):
                for i in range(3):
                    outside[3 * a + i] = work[3 * rows[a] + i]
            np.dot(W, outside[:b], inside[:n])
            work[3 * first[number] : 3 * first[number + 1]] -= inside[:n]
