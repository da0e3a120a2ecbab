"""Nodes that have the same neighbours, taken together: a smaller graph with the same separators.

Such nodes are those in the inside of an edge or a face of the same elements.  A separator that is
as small as can be has all of them or none, and so has every front (Ashcraft 1995, compressed
graphs).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numba
import numpy as np

from carillon.arrays import Index

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX = np.uint64(0xBF58476D1CE4E5B9)
_HALF = np.uint64(32)


@dataclass(frozen=True)
class Quotient:
    """A graph of groups of nodes."""

    nodes: Index
    """Nodes group by group, ascending within one."""
    offset: Index
    """(g + 1,) first node of each group in `nodes`."""
    lattice: Index
    """(g, 3) integer coordinates of the middle of each group, rounded down."""
    indptr: Index
    indices: Index
    """Graph of the groups in compressed rows, without the diagonal."""

    @classmethod
    def of_graph(cls, lattice: Index, indptr: Index, indices: Index, inside: Index) -> Quotient:
        """Groups of the nodes `inside` a graph in compressed rows, whose rows ascend.

        Each node is its own neighbour; `lattice` (n, 3) are the nodes' integer coordinates.
        """
        group, count = _groups(indptr, indices, inside)
        order = np.argsort(group, kind="stable")
        offset = np.searchsorted(group[order], np.arange(count + 1))
        nodes = inside[order]
        sums = np.add.reduceat(lattice[nodes], offset[:-1]) if count else lattice[:0]
        number = np.full(len(indptr) - 1, -1, dtype=np.int64)
        number[inside] = group
        graph = _graph(indptr, indices, number, nodes[offset[:-1]])
        return cls(nodes, offset, sums // np.diff(offset)[:, None], *graph)

    @property
    def sizes(self) -> Index:
        """Number (g,) of nodes in each group."""
        return np.diff(self.offset)

    def __len__(self) -> int:
        """Number of groups."""
        return len(self.offset) - 1

    def part(self, groups: Index) -> tuple[Index, Index]:
        """Compressed rows of the graph of some groups alone, numbered in their order."""
        graph: tuple[Index, Index] = _part(self.indptr, self.indices, groups, self._unnumbered)
        return graph

    @cached_property
    def _unnumbered(self) -> Index:
        return np.full(len(self), -1, dtype=np.int64)

    def around(self, groups: Index) -> int:
        """Number of nodes beside some groups."""
        beside = np.zeros(len(self), dtype=bool)
        _mark_beside(self.indptr, self.indices, groups, beside)
        return int(self.sizes[beside].sum())

    def nodes_of(self, groups: Index) -> Index:
        """Nodes of some groups."""
        counts = self.sizes[groups]
        starts = np.repeat(self.offset[groups] - np.cumsum(counts) + counts, counts)
        return self.nodes[starts + np.arange(len(starts))]


@numba.njit(cache=True, nogil=True)
def _part(indptr, indices, chosen, local):  # type: ignore[no-untyped-def]
    """Graph of the `chosen` vertices alone, numbered in their order.

    `local` has -1 for every vertex, and again on return.
    """
    total = 0
    for number in range(len(chosen)):
        vertex = chosen[number]
        local[vertex] = number
        total += indptr[vertex + 1] - indptr[vertex]
    starts, others = np.zeros(len(chosen) + 1, dtype=np.int64), np.empty(total, dtype=np.int64)
    end = 0
    for number in range(len(chosen)):
        for entry in range(indptr[chosen[number]], indptr[chosen[number] + 1]):
            other = local[indices[entry]]
            if other >= 0:
                others[end] = other
                end += 1
        starts[number + 1] = end
    for vertex in chosen:
        local[vertex] = -1
    return starts, others[:end].copy()


@numba.njit(cache=True, nogil=True)
def _mark_beside(indptr, indices, chosen, beside):  # type: ignore[no-untyped-def]
    """Mark the neighbours of the `chosen` vertices that are none of them."""
    for vertex in chosen:
        for entry in range(indptr[vertex], indptr[vertex + 1]):
            beside[indices[entry]] = True
    for vertex in chosen:
        beside[vertex] = False


@numba.njit(cache=True, nogil=True)
def pieces_of(indptr, indices):  # type: ignore[no-untyped-def]
    """Number (n,) of the connected piece that each vertex is of, and how many there are."""
    piece = np.full(len(indptr) - 1, -1)
    waiting = np.empty(len(piece), dtype=np.int64)
    count = 0
    for start in range(len(piece)):
        if piece[start] >= 0:
            continue
        piece[start], waiting[0], top = count, start, 1
        while top:
            top -= 1
            vertex = waiting[top]
            for entry in range(indptr[vertex], indptr[vertex + 1]):
                if piece[indices[entry]] < 0:
                    piece[indices[entry]] = count
                    waiting[top] = indices[entry]
                    top += 1
        count += 1
    return piece, count


@numba.njit(cache=True, nogil=True)
def _groups(indptr, indices, inside):  # type: ignore[no-untyped-def]
    """Group of each node `inside`, in the order of their first nodes, and how many there are."""
    keys = np.zeros(len(inside), dtype=np.uint64)
    for number in range(len(inside)):
        for entry in range(indptr[inside[number]], indptr[inside[number] + 1]):
            bits = np.uint64(indices[entry] + 1) * _GOLDEN
            keys[number] += (bits ^ (bits >> _HALF)) * _MIX
    # The first of each key stands for the others; where rows differ after all, it is alone.
    first = {keys[0]: 0} if len(keys) else {np.uint64(0): 0}
    group = np.empty(len(inside), dtype=np.int64)
    count = 0
    for number in range(len(inside)):
        other = first.setdefault(keys[number], number)
        if other != number and _same_row(indptr, indices, inside[other], inside[number]):
            group[number] = group[other]
        else:
            group[number] = count
            count += 1
    return group, count


@numba.njit(cache=True, nogil=True)
def _same_row(indptr, indices, one, other):  # type: ignore[no-untyped-def]
    size = indptr[one + 1] - indptr[one]
    if size != indptr[other + 1] - indptr[other]:
        return False
    for entry in range(size):
        if indices[indptr[one] + entry] != indices[indptr[other] + entry]:
            return False
    return True


@numba.njit(cache=True, nogil=True)
def _graph(indptr, indices, number, first):  # type: ignore[no-untyped-def]
    """Compressed rows of the groups, by the group (n,) of each node, and their first nodes."""
    seen = np.full(len(first), -1)
    starts, room = np.zeros(len(first) + 1, dtype=np.int64), 0
    for node in first:
        room += indptr[node + 1] - indptr[node]
    others = np.empty(room, dtype=np.int64)
    end = 0
    for group in range(len(first)):
        seen[group] = group
        for entry in range(indptr[first[group]], indptr[first[group] + 1]):
            other = number[indices[entry]]
            if other >= 0 and seen[other] != group:
                seen[other] = group
                others[end] = other
                end += 1
        starts[group + 1] = end
    return starts, others[:end].copy()
