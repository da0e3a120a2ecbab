"""Multifrontal factorisation of K - shift M, made for many right-hand sides at once.

Every front is eliminated by panels of its own rows, which keep the inverse of their diagonal block
and its product W with what couples them to later rows (Duff & Reid 1983, with inverted pivots).  A
solve is then nothing but products of dense matrices; threads share the branches of the tree.  Each
panel pivots within itself, so the matrix need not be definite.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numba
import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from carillon.errors import LocalConvergenceError
from carillon.lanes import compiler
from carillon.registers import LANES
from carillon.runtime import available_memory
from carillon.threads import in_parallel, split
from solver.linear import narrow
from solver.linear.dissection import Fronts, dissect
from solver.linear.narrow import block, lanes_of, subtract

Array = NDArray[np.float64]
Index = NDArray[np.int64]

compiled = compiler(Path(__file__), Path(narrow.__file__))

COLUMNS = 64
"""Right-hand sides that are carried through the fronts together."""
STRIP = 192
"""Columns of W that lie together in memory, row by row."""
BRANCHES = 3
"""Branches for each thread, at least: their work is not equal."""
UPDATES_FRACTION = 1.3
"""Memory at its peak, when updates wait for their parents, as a share of what the factor takes."""
PANEL = 120
"""Rows of a front that are eliminated together, and of a symmetric product that are formed."""


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
        self.pivot_offset = np.concatenate([[0], np.cumsum([_pivot_entries(n) for n in own])])
        self.coupling_offset = np.concatenate([[0], np.cumsum(own * outside)])
        self.bytes = int(UPDATES_FRACTION * 8 * (self.pivot_offset[-1] + self.coupling_offset[-1]))
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


def _pivot_entries(n: int) -> int:
    """Entries of the panels of n own rows, each from its first column on."""
    return sum((stop - start) * (n - start) for start, stop in split(n, 1, PANEL))


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
    lasting = True

    def __init__(
        self, plan: Plan, stiffness: Array, mass: Array, shift: float, threads: int = 1
    ) -> None:
        self._plan = plan
        self._threads = threads
        self.shift = shift
        _require_memory(plan)
        self._pivots = np.empty(plan.pivot_offset[-1])
        self._coupling = np.empty(plan.coupling_offset[-1])
        self.negative = self._factor(stiffness, mass)

    def destroy(self) -> None:
        """Nothing but arrays to free."""

    def _factor(self, stiffness: Array, mass: Array) -> int:
        plan = self._plan
        updates: dict[int, Array] = {}
        first = plan.fronts.first

        def eliminate(front: int) -> int:
            n = 3 * int(first[front + 1] - first[front])
            b = 3 * len(plan.fronts.boundary[front])
            pivots = self._pivots[plan.pivot_offset[front] : plan.pivot_offset[front + 1]]
            coupling = self._coupling[plan.coupling_offset[front] : plan.coupling_offset[front + 1]]
            own = np.zeros((n, n + b))
            _add_entries(own, plan.entries[front], stiffness, mass, self.shift)
            # A piece that nothing connects to the rest has no update.
            children = [child for child in plan.children[front] if child in updates]
            for child in children:
                _subtract_from_own(own, plan.places[child], updates[child])
            scaled, negative = _eliminate_panels(own, pivots)
            for strip in range(0, b, STRIP):
                few = min(STRIP, b - strip)
                kept = coupling[n * strip : n * (strip + few)].reshape(n, few)
                kept[:] = scaled[:, n + strip : n + strip + few]
            if b:
                update = _product(own[:, n:], scaled[:, n:])
                for child in children:
                    _add_beyond(update, n // 3, plan.places[child], updates.pop(child))
                updates[front] = update
            return negative

        def eliminate_all(part: Part) -> int:
            return sum(eliminate(int(front)) for front in part.fronts)

        shares = plan.shares(self._threads)
        branches = [(part,) for part in shares.branches]
        negative = sum(in_parallel(eliminate_all, branches, self._threads))
        return negative + eliminate_all(shares.top)

    def solve(self, vectors: Array) -> Array:
        """Solution (3 n, k) for a C-ordered block of right-hand sides (3 n, k)."""
        solution = np.empty_like(vectors)
        for start, stop in split(vectors.shape[1], 1, COLUMNS):
            self._solve_columns(vectors, solution, start, stop)
        return solution

    def _solve_columns(self, vectors: Array, solution: Array, start: int, stop: int) -> None:
        """Solve for the columns [start, stop): up the branches, through the top, down again."""
        plan, threads, width = self._plan, self._threads, stop - start
        shares = plan.shares(threads)
        order = plan.fronts.order
        top, lanes = shares.top, lanes_of(width)

        def taken(part: Part) -> Array:
            work = block(3 * (len(part.positions) + len(part.beyond)), lanes)
            _take_rows(vectors, start, width, order[part.positions], lanes, work)
            return work

        def up(part: Part) -> Array:
            work = taken(part)
            self._sweep(_eliminate, part, work, lanes)
            return work

        def down(part: Part, work: Array) -> None:
            if len(part.beyond):
                rows = np.searchsorted(top.positions, part.beyond)
                _copy_nodes(above, 3 * len(part.positions), rows, lanes, work)
            self._sweep(_substitute, part, work, lanes)
            _put_rows(work, order[part.positions], lanes, solution, start, width)

        works = in_parallel(up, [(part,) for part in shares.branches], threads)
        above = taken(top)
        if len(top.fronts):
            for part, work in zip(shares.branches, works, strict=True):
                rows = np.searchsorted(top.positions, part.beyond)
                _add_nodes(work, 3 * len(part.positions), rows, lanes, above)
            self._sweep(_eliminate, top, above, lanes)
            self._sweep(_substitute, top, above, lanes)
            _put_rows(above, order[top.positions], lanes, solution, start, width)
        in_parallel(down, list(zip(shares.branches, works, strict=True)), threads)

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


def _require_memory(plan: Plan) -> None:
    """The system lends memory that it has not got, and kills who uses it."""
    available = available_memory()
    if available is not None and plan.bytes > available:
        raise LocalConvergenceError(
            f"the sparse factorisation of {3 * len(plan.position):,} unknowns takes about "
            f"{plan.bytes / 1e9:.1f} GB, {available / 1e9:.1f} GB are free; use --linear-solver "
            "amg-cg, or mumps on more ranks of more machines"
        )


def _eliminate_panels(own: Array, pivots: Array) -> tuple[Array, int]:
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


def _product(left: Array, right: Array) -> Array:
    """The upper triangle of left^T right, which is symmetric; below it anything."""
    size = left.shape[1]
    product = np.empty((size, size))
    for start, stop in split(size, 1, PANEL):
        np.matmul(left[:, start:stop].T, right[:, start:], out=product[start:stop, start:])
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


@compiled
def _take_rows(vectors, start, width, nodes, lanes, work):  # type: ignore[no-untyped-def]
    """Rows of `nodes` of the columns from `start` on, as the first rows of a block."""
    flat = work.reshape(-1)
    for a in range(len(nodes)):
        for i in range(3):
            row = (3 * a + i) * lanes * LANES
            flat[row : row + width] = vectors[3 * nodes[a] + i, start : start + width]


@compiled
def _put_rows(work, nodes, lanes, vectors, start, width):  # type: ignore[no-untyped-def]
    flat = work.reshape(-1)
    for a in range(len(nodes)):
        for i in range(3):
            row = (3 * a + i) * lanes * LANES
            vectors[3 * nodes[a] + i, start : start + width] = flat[row : row + width]


@compiled
def _copy_nodes(source, place, nodes, lanes, target):  # type: ignore[no-untyped-def]
    """Rows of `nodes` of a block become the rows of another from `place` on."""
    size = 3 * lanes
    for a in range(len(nodes)):
        row = place * lanes + size * a
        target[row : row + size] = source[size * nodes[a] : size * (nodes[a] + 1)]


@compiled
def _add_nodes(source, place, nodes, lanes, target):  # type: ignore[no-untyped-def]
    """The rows of a block from `place` on are added to the rows of `nodes` of another."""
    size = 3 * lanes
    for a in range(len(nodes)):
        row = place * lanes + size * a
        target[size * nodes[a] : size * (nodes[a] + 1)] += source[row : row + size]


@compiled
def _largest(first, near_offset):  # type: ignore[no-untyped-def]
    """Own rows of the tallest front, and rows that the widest is coupled to."""
    tallest = longest = 0
    for number in range(len(first) - 1):
        tallest = max(tallest, 3 * (first[number + 1] - first[number]))
        longest = max(longest, 3 * (near_offset[number + 1] - near_offset[number]))
    return tallest, longest


@compiled
def _eliminate(  # type: ignore[no-untyped-def]
    work, lanes, fronts, first, near, near_offset, pivots, pivot_offset, coupling, coupling_offset
):
    tallest, longest = _largest(first, near_offset)
    inside, outside = block(tallest, lanes), block(longest, lanes)
    for number in range(len(fronts)):
        front, top = fronts[number], 3 * first[number]
        n = 3 * first[number + 1] - top
        panels = -(-n // PANEL)
        place = pivot_offset[front]
        for panel in range(panels):
            start, stop = -(-n * panel // panels), -(-n * (panel + 1) // panels)
            size, rest = stop - start, n - stop
            later = (pivots, place + size * size, 1, rest)
            subtract(later, rest, size, (work, top + start, lanes), (work, top + stop, lanes))
            place += size * (size + rest)
        rows = near[near_offset[number] : near_offset[number + 1]]
        outside[: 3 * len(rows) * lanes] = 0.0
        for start in range(0, 3 * len(rows), STRIP):
            size = min(STRIP, 3 * len(rows) - start)
            strip = (coupling, coupling_offset[front] + n * start, 1, size)
            subtract(strip, size, n, (work, top, lanes), (outside, start, lanes))
        _add_nodes(outside, 0, rows, lanes, work)
        place = pivot_offset[front]
        for panel in range(panels):
            start, stop = -(-n * panel // panels), -(-n * (panel + 1) // panels)
            size = stop - start
            inside[: size * lanes] = 0.0
            own = (work, top + start, lanes)
            subtract((pivots, place, size, 1), size, size, own, (inside, 0, lanes))
            work[(top + start) * lanes : (top + stop) * lanes] = -inside[: size * lanes]
            place += size * (n - start)


@compiled
def _substitute(  # type: ignore[no-untyped-def]
    work, lanes, fronts, first, near, near_offset, pivots, pivot_offset, coupling, coupling_offset
):
    outside = block(_largest(first, near_offset)[1], lanes)
    for number in range(len(fronts) - 1, -1, -1):
        front, top = fronts[number], 3 * first[number]
        n = 3 * first[number + 1] - top
        rows = near[near_offset[number] : near_offset[number + 1]]
        _copy_nodes(work, 0, rows, lanes, outside)
        for start in range(0, 3 * len(rows), STRIP):
            size = min(STRIP, 3 * len(rows) - start)
            strip = (coupling, coupling_offset[front] + n * start, size, 1)
            subtract(strip, n, size, (outside, start, lanes), (work, top, lanes))
        panels = -(-n // PANEL)
        place = pivot_offset[front + 1]
        for panel in range(panels - 1, -1, -1):
            start, stop = -(-n * panel // panels), -(-n * (panel + 1) // panels)
            size, rest = stop - start, n - stop
            later = (pivots, place - size * rest, rest, 1)
            subtract(later, size, rest, (work, top + stop, lanes), (work, top + start, lanes))
            place -= size * (size + rest)
