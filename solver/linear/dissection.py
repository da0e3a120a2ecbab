"""Nested dissection of the nodes of a voxel mesh by planes (George 1973), and its symbolic fronts.

A plane of nodes between elements separates those on its two sides.  Cutting recursively gives a
tree of fronts: the nodes of a plane are eliminated after everything that they separate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
    boundary
        Sorted positions, after the front's own, that each front is coupled to.
    """

    order: Index
    first: Index
    parent: Index
    boundary: list[Index]

    def __len__(self) -> int:
        """Number of fronts."""
        return len(self.parent)

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
        outside = 3 * np.array([len(boundary) for boundary in self.boundary])
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
    position = np.empty(len(order), dtype=np.int64)
    position[order] = np.arange(len(order))
    boundary = _boundaries(position[indices], indptr, order, first, parent)
    return Fronts(order, first, np.array(parent, dtype=np.int64), boundary)


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


def _boundaries(
    neighbours: Index, indptr: Index, order: Index, first: Index, parent: list[int]
) -> list[Index]:
    none = np.empty(0, dtype=np.int64)
    boundary: list[Index] = []
    inherited: list[list[Index]] = [[] for _ in parent]
    for front, above in enumerate(parent):
        stop = first[front + 1]
        rows = order[first[front] : stop]
        touched = [neighbours[indptr[row] : indptr[row + 1]] for row in rows]
        reached = np.unique(np.concatenate([none, *touched, *inherited[front]]))
        outside = reached[np.searchsorted(reached, stop) :]
        boundary.append(outside)
        inherited[front].clear()
        if above >= 0:
            inherited[above].append(outside)
    return boundary
