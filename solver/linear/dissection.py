"""Nested dissection of the nodes of a voxel mesh by planes (George 1973), and its symbolic fronts.

A plane of nodes between elements separates those on its two sides.  Cutting recursively gives a
tree of fronts: the nodes of a plane are eliminated after everything that they separate.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Index
from solver.linear import symbolic

LEAF_NODES = 48
"""Number of nodes that are eliminated together instead of cut."""
SHORTEST_SIDE = 0.2
"""Least share of the nodes on either side of a cut, if there is such a cut."""


@dataclass(frozen=True)
class Fronts:
    """Elimination order and fronts of a symmetric matrix of 3x3 node blocks."""

    order: Index
    """(n,) nodes in the order of elimination."""
    first: Index
    """(fronts + 1,) first position eliminated by each front; children come before parents."""
    parent: Index
    """(fronts,) parent of each front, -1 for a root."""
    position: Index
    """(n,) place of each node in `order`."""
    offset: Index
    beyond: Index
    """Positions, after the front's own, that each front is coupled to, in compressed form;
    ascending within a front."""

    @classmethod
    def of_order(
        cls, order: Index, first: Index, parent: Index, indptr: Index, indices: Index
    ) -> Fronts:
        """Fronts that eliminate the nodes of a graph, in compressed rows, in this order."""
        position = np.empty_like(order)
        position[order] = np.arange(len(order))
        offset, beyond = symbolic.boundaries(indptr, indices, order, position, first, parent)
        return cls(order, first, parent, position, offset, beyond)

    def __len__(self) -> int:
        """Number of fronts."""
        return len(self.parent)

    def entries(self, indptr: Index, indices: Index) -> list[NDArray[np.int32]]:
        """Block entries (e, 3) of each front, which no earlier front has.

        Row and column in the front, and number in the data of the graph.
        """
        tree = self.order, self.position, self.first, self.offset, self.beyond
        start, entries = symbolic.entries(indptr, indices, *tree)
        return np.split(entries, start[1:-1])

    def places(self) -> list[Index]:
        """Place of each front's boundary in its parent's front."""
        places = symbolic.places(self.first, self.parent, self.offset, self.beyond)
        return np.split(places, self.offset[1:-1])

    @cached_property
    def boundary(self) -> list[Index]:
        """Positions that each front is coupled to."""
        return np.split(self.beyond, self.offset[1:-1])

    def children(self) -> list[list[int]]:
        """Children of each front, in order."""
        children: list[list[int]] = [[] for _ in range(len(self))]
        for front, parent in enumerate(self.parent):
            if parent >= 0:
                children[parent].append(front)
        return children


def dissect(
    lattice: Index, indptr: Index, indices: Index, steps: int = 1, leaf_nodes: int = LEAF_NODES
) -> Fronts:
    """Order the nodes and find the fronts.

    Parameters
    ----------
    lattice
        (n, 3) integer coordinates of the nodes.
    indptr, indices
        Graph of the nodes in compressed rows: which nodes share an element.
    steps
        Planes of the lattice that far apart, from zero on, separate the elements between them.
    leaf_nodes
        Sets of at most this many nodes are not cut.
    """
    owns: list[Index] = []
    parent: list[int] = []
    _cut(lattice, np.arange(len(lattice)), steps, leaf_nodes, owns, parent)
    order = np.concatenate(owns)
    first = np.concatenate([[0], np.cumsum([len(own) for own in owns])])
    return Fronts.of_order(order, first, np.array(parent, dtype=np.int64), indptr, indices)


def _cut(
    lattice: Index, nodes: Index, steps: int, leaf_nodes: int, owns: list[Index], parent: list[int]
) -> int:
    """Append the fronts of `nodes`, children first; returns the number of the last, their root."""
    axis, value = _best_plane(lattice, nodes, steps) if len(nodes) > leaf_nodes else (-1, 0)
    children = []
    own = nodes
    if axis >= 0:
        own, *sides = _divided(lattice, nodes, axis, value)
        for side in sides:
            children.append(_cut(lattice, side, steps, leaf_nodes, owns, parent))
    owns.append(own)
    parent.append(-1)
    for child in children:
        parent[child] = len(owns) - 1
    return len(owns) - 1


@numba.njit(cache=True, nogil=True)
def _best_plane(lattice, nodes, steps):  # type: ignore[no-untyped-def]
    """Axis and coordinate of the plane with few nodes that leaves two sides of similar size.

    Axis -1 if there is none.
    """
    best = (-1, 0)
    lowest = np.inf
    for axis in range(3):
        start = stop = lattice[nodes[0], axis]
        for node in nodes:
            start, stop = min(start, lattice[node, axis]), max(stop, lattice[node, axis])
        count = np.zeros(stop + 1 - start, dtype=np.int64)
        for node in nodes:
            count[lattice[node, axis] - start] += 1
        # The best of all planes, and of those with enough nodes on either side.
        costs, values = [np.inf, np.inf], [start, start]
        below = 0
        for plane in range(len(count)):
            above = len(nodes) - below - count[plane]
            smaller = min(below, above)
            if smaller > 0 and (start + plane) % steps == 0:
                cost = count[plane] / np.sqrt(below * above)
                for kind, least in enumerate((0.0, SHORTEST_SIDE * len(nodes))):
                    if smaller >= least and cost < costs[kind]:
                        costs[kind], values[kind] = cost, start + plane
            below += count[plane]
        kind = 1 if costs[1] < np.inf else 0
        if costs[kind] < lowest:
            lowest = costs[kind]
            best = (axis, values[kind])
    return best


@numba.njit(cache=True, nogil=True)
def _divided(lattice, nodes, axis, value):  # type: ignore[no-untyped-def]
    """Nodes on a plane, below it and above it, in their order."""
    coordinate = lattice[nodes, axis]
    return nodes[coordinate == value], nodes[coordinate < value], nodes[coordinate > value]
