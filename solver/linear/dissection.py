"""Nested dissection of the nodes of a voxel mesh by planes (George 1973), and its symbolic fronts.

A plane of nodes between elements separates those on its two sides.  Cutting recursively gives a
tree of fronts: the nodes of a plane are eliminated after everything that they separate.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from solver.linear import symbolic

Index = NDArray[np.int64]

LEAF_NODES = 48
"""Nodes that are no longer cut but eliminated together."""
SHORTEST_SIDE = 0.2
"""Least share of the nodes on either side of a cut, if there is such a cut."""


@dataclass(frozen=True)
class Fronts:
    """Elimination order and fronts of a symmetric matrix of 3x3 node blocks.

    Attributes
    ----------
    order
        (n,) nodes in the order of elimination.
    first
        (fronts + 1,) first position eliminated by each front; children come before parents.
    parent
        (fronts,) parent of each front, -1 for a root.
    position
        (n,) place of each node in `order`.
    offset, beyond
        Positions, after the front's own, that each front is coupled to, in compressed form;
        ascending within a front.
    """

    order: Index
    first: Index
    parent: Index
    position: Index
    offset: Index
    beyond: Index

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

    def solve_flops(self) -> int:
        """Floating-point operations of a solve with one right-hand side."""
        own = 3 * np.diff(self.first)
        outside = 3 * np.diff(self.offset)
        return int((2 * own**2 + 4 * own * outside).sum())


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
    lattice: Index,
    nodes: Index,
    steps: int,
    leaf_nodes: int,
    owns: list[Index],
    parent: list[int],
) -> int:
    """Append the fronts of `nodes`, children first; returns the number of the last, their root."""
    plane = _best_plane(lattice[nodes], steps) if len(nodes) > leaf_nodes else None
    children = []
    own = nodes
    if plane is not None:
        axis, value = plane
        coordinate = lattice[nodes, axis]
        own = nodes[coordinate == value]
        for side in (coordinate < value, coordinate > value):
            children.append(_cut(lattice, nodes[side], steps, leaf_nodes, owns, parent))
    owns.append(own)
    parent.append(-1)
    for child in children:
        parent[child] = len(owns) - 1
    return len(owns) - 1


def _best_plane(lattice: Index, steps: int) -> tuple[int, int] | None:
    """Axis and coordinate of the plane with few nodes that leaves two sides of similar size."""
    best = None
    lowest = np.inf
    for axis in range(3):
        start = lattice[:, axis].min()
        count = np.bincount(lattice[:, axis] - start)
        below = np.cumsum(count) - count
        above = len(lattice) - below - count
        smaller = np.minimum(below, above)
        separates = (start + np.arange(len(count))) % steps == 0
        fair = separates & (smaller >= SHORTEST_SIDE * len(lattice))
        allowed = fair if fair.any() else separates & (smaller > 0)
        if not allowed.any():
            continue
        cost = np.where(allowed, count / np.maximum(below * above, 1) ** 0.5, np.inf)
        if cost.min() < lowest:
            lowest = cost.min()
            best = (axis, int(np.argmin(cost) + start))
    return best
