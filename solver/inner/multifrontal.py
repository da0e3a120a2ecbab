"""Multifrontal factorisation of K - shift M, made for many right-hand sides at once.

Every front keeps the inverse of its own block and its product W with the coupling to what is
eliminated later (Duff & Reid 1983, with inverted pivots).  A solve is then nothing but products of
dense matrices, which threads share by columns; each front pivots within itself, so the matrix need
not be definite.
"""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.threads import in_parallel, split
from solver.inner.dissection import Fronts, dissect

Array = NDArray[np.float64]
Index = NDArray[np.int64]

COLUMNS = 96
"""Right-hand sides that a thread carries through the fronts together."""


class Plan:
    """What a factorisation needs to know of the sparsity alone: made once, used for any material.

    Parameters
    ----------
    planes
        (n, 3) integer coordinates of the nodes.
    indptr, indices
        Node graph in compressed rows; the data of `Factor` follow it.
    """

    def __init__(self, planes: Index, indptr: Index, indices: Index, **options: Any) -> None:
        self.fronts: Fronts = dissect(planes, indptr, indices, **options)
        fronts = self.fronts
        self.position = np.empty(len(fronts.order), dtype=np.int64)
        self.position[fronts.order] = np.arange(len(fronts.order))
        self.children = fronts.children()
        self.entries = [
            self._entries(front, indptr, self.position[indices]) for front in range(len(fronts))
        ]
        self.places = self._places()
        own = 3 * np.diff(fronts.first)
        outside = 3 * np.array([len(boundary) for boundary in fronts.boundary])
        self.inverse_offset = np.concatenate([[0], np.cumsum(own**2)])
        self.coupling_offset = np.concatenate([[0], np.cumsum(own * outside)])
        self.boundary_offset = np.concatenate([[0], np.cumsum(outside // 3)])
        self.boundary = np.concatenate([np.empty(0, dtype=np.int64), *fronts.boundary])

    def _entries(self, front: int, indptr: Index, column: Index) -> Index:
        """Block entries (e, 3) of a front: row and column in it, and number in the data."""
        start, stop = self.fronts.first[front : front + 2]
        rows = self.fronts.order[start:stop]
        counts = indptr[rows + 1] - indptr[rows]
        number = np.repeat(indptr[rows] - np.cumsum(counts) + counts, counts) + np.arange(
            counts.sum()
        )
        row = np.repeat(np.arange(stop - start), counts)
        position = column[number]
        later = position >= start
        row, number, position = row[later], number[later], position[later]
        inside = position < stop
        outside = (stop - start) + np.searchsorted(self.fronts.boundary[front], position)
        return np.stack([row, np.where(inside, position - start, outside), number], axis=1)

    def _places(self) -> list[Index]:
        """Place of each front's boundary in its parent's front."""
        places = []
        for front, parent in enumerate(self.fronts.parent):
            boundary = self.fronts.boundary[front]
            if parent < 0:
                places.append(boundary)
                continue
            start, stop = self.fronts.first[parent : parent + 2]
            outside = (stop - start) + np.searchsorted(self.fronts.boundary[parent], boundary)
            places.append(np.where(boundary < stop, boundary - start, outside))
        return places


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
        Threads that share the right-hand sides.
    """

    exact = True

    def __init__(
        self, plan: Plan, stiffness: Array, mass: Array, shift: float, threads: int = 1
    ) -> None:
        self._plan = plan
        self._threads = threads
        self.shift = shift
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
                rest -= outside.T @ product
                update[front] = rest
            elif b:
                update[front] = matrix

        for front in range(len(plan.fronts)):
            eliminate(front)

    def solve(self, block: Array) -> Array:
        """Solution (3 n, k) for a C-ordered block of right-hand sides (3 n, k)."""
        plan = self._plan
        solution = np.empty_like(block)
        order = plan.fronts.order

        def columns(start: int, stop: int) -> None:
            _solve(
                block,
                solution,
                start,
                stop,
                order,
                plan.fronts.first,
                plan.boundary,
                plan.boundary_offset,
                self._inverse,
                plan.inverse_offset,
                self._coupling,
                plan.coupling_offset,
            )

        threads = self._threads
        in_parallel(columns, split(block.shape[1], threads, COLUMNS), threads)
        return solution


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
def _solve(  # type: ignore[no-untyped-def]
    block,
    solution,
    start,
    stop,
    order,
    first,
    boundary,
    boundary_offset,
    inverse,
    inverse_offset,
    coupling,
    coupling_offset,
):
    width = stop - start
    work = np.empty((3 * len(order), width))
    for position in range(len(order)):
        for i in range(3):
            work[3 * position + i] = block[3 * order[position] + i, start:stop]
    fronts = len(first) - 1
    longest = 0
    tallest = 0
    for front in range(fronts):
        longest = max(longest, 3 * (boundary_offset[front + 1] - boundary_offset[front]))
        tallest = max(tallest, 3 * (first[front + 1] - first[front]))
    outside = np.empty((longest, width))
    inside = np.empty((tallest, width))
    for front in range(fronts):
        n = 3 * (first[front + 1] - first[front])
        own = work[3 * first[front] : 3 * first[front + 1]]
        pivot = inverse[inverse_offset[front] : inverse_offset[front + 1]].reshape(n, n)
        near = boundary[boundary_offset[front] : boundary_offset[front + 1]]
        b = 3 * len(near)
        if n == 0:
            continue
        if b:
            W = coupling[coupling_offset[front] : coupling_offset[front + 1]].reshape(n, b)
            np.dot(W.T, own, outside[:b])
            for a in range(len(near)):
                for i in range(3):
                    work[3 * near[a] + i] -= outside[3 * a + i]
        np.dot(pivot, own, inside[:n])
        own[:] = inside[:n]
    for front in range(fronts - 1, -1, -1):
        near = boundary[boundary_offset[front] : boundary_offset[front + 1]]
        b = 3 * len(near)
        n = 3 * (first[front + 1] - first[front])
        if n and b:
            W = coupling[coupling_offset[front] : coupling_offset[front + 1]].reshape(n, b)
            for a in range(len(near)):
                for i in range(3):
                    outside[3 * a + i] = work[3 * near[a] + i]
            np.dot(W, outside[:b], inside[:n])
            work[3 * first[front] : 3 * first[front + 1]] -= inside[:n]
    for position in range(len(order)):
        for i in range(3):
            solution[3 * order[position] + i, start:stop] = work[3 * position + i]
