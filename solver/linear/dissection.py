"""Nested dissection of the nodes of a mesh by planes (George 1973), and its symbolic fronts.

A plane of nodes between elements separates those on its two sides; where planes pass through
elements, some nodes beside one do (`solver.distribution.cuts`).  Cutting recursively gives a tree
of fronts: the nodes of a cut are eliminated after everything that they separate.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Index
from solver.distribution.cuts import ABOVE, BELOW, BETWEEN, halves
from solver.distribution.planes import best_plane, divided
from solver.distribution.quotient import Quotient, pieces_of
from solver.linear import symbolic

LEAF_NODES = 48
"""Number of nodes that are eliminated together instead of cut."""


@dataclass(frozen=True)
class Fronts:
    """Elimination order and fronts of a symmetric matrix of 3x3 node blocks."""

    order: Index
    """(n,) nodes in the order of elimination, those that are kept last."""
    first: Index
    """(fronts + 1,) first position eliminated by each front; children come before parents."""
    parent: Index
    """(fronts,) parent of each front, -1 for a root."""
    position: Index
    """Place in `order` of each node of the graph; -1 for those that are not in it."""
    offset: Index
    beyond: Index
    """Positions, after the front's own, that each front is coupled to, in compressed form;
    ascending within a front."""

    @classmethod
    def of_order(
        cls,
        order: Index,
        first: Index,
        parent: Index,
        indptr: Index,
        indices: Index,
        kept: Index | None = None,
    ) -> Fronts:
        """Fronts that eliminate the nodes of a graph, in compressed rows, in this order.

        What they leave of the nodes `kept` goes to one more front, which eliminates nothing.
        """
        if kept is not None:
            order = np.concatenate([order, kept])
            first = np.append(first, first[-1])
            parent = np.append(np.where(parent < 0, len(parent), parent), -1)
        position = np.full(len(indptr) - 1, -1, dtype=np.int64)
        position[order] = np.arange(len(order))
        offset, beyond = symbolic.boundaries(indptr, indices, order, position, first, parent)
        if kept is not None:
            beyond = np.concatenate([beyond[: offset[-2]], np.arange(first[-1], len(order))])
            offset[-1] = len(beyond)
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

    def kept_entries(self, indptr: Index, indices: Index) -> NDArray[np.int32]:
        """Block entries (e, 3) among the nodes that are kept, see `entries`.

        The diagonal and those to its right: of two nodes, the row of the earlier one counts.
        """
        kept = self.order[self.first[-1] :]
        counts = indptr[kept + 1] - indptr[kept]
        row = np.repeat(np.arange(len(kept)), counts)
        starts = np.repeat(indptr[kept] - np.cumsum(counts) + counts, counts)
        number = starts + np.arange(len(row))
        column = self.position[indices[number]] - self.first[-1]
        return np.stack([row, column, number], axis=1)[column >= row].astype(np.int32)

    def places(self) -> list[Index]:
        """Place of each front's boundary in its parent's front."""
        places = symbolic.places(len(self.order), self.first, self.parent, self.offset, self.beyond)
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
    lattice: Index,
    indptr: Index,
    indices: Index,
    steps: int | None = 1,
    leaf_nodes: int = LEAF_NODES,
    inside: Index | None = None,
    kept: Index | None = None,
) -> Fronts:
    """Order the nodes and find the fronts.

    Parameters
    ----------
    lattice
        (n, 3) integer coordinates of the nodes.
    indptr, indices
        Graph of the nodes in compressed rows, which ascend: which nodes share an element.
    steps
        Planes of the lattice that far apart, from zero on, separate the elements between them;
        None if none do, so that the graph is cut.
    leaf_nodes
        Sets of at most this many nodes are not cut.
    inside
        Nodes to eliminate; all if not given.
    kept
        Nodes that are not eliminated, in the order in which others will.
    """
    inside = np.arange(len(lattice)) if inside is None else inside
    tree = _Tree([], [])
    if len(inside) and steps is not None:
        _cut(lattice, inside, steps, leaf_nodes, tree)
    elif len(inside):
        quotient = Quotient.of_graph(lattice, indptr, indices, inside)
        _cut_graph(quotient, np.arange(len(quotient)), leaf_nodes, tree)
    order = np.concatenate([inside[:0], *tree.owns])
    first = np.concatenate([[0], np.cumsum([len(own) for own in tree.owns], dtype=np.int64)])
    above = np.array(tree.parent, dtype=np.int64)
    return Fronts.of_order(order, first, above, indptr, indices, kept)


class _Tree(NamedTuple):
    """Fronts as they are found, children first."""

    owns: list[Index]
    """What each front eliminates."""
    parent: list[int]

    def append(self, own: Index, children: list[int]) -> int:
        """Append a front; returns its number."""
        self.owns.append(own)
        self.parent.append(-1)
        for child in children:
            self.parent[child] = len(self.owns) - 1
        return len(self.owns) - 1


def _cut(lattice: Index, nodes: Index, steps: int, leaf_nodes: int, tree: _Tree) -> int:
    """Append the fronts of `nodes`; returns the number of the last, their root."""
    axis, value = best_plane(lattice, nodes, steps) if len(nodes) > leaf_nodes else (-1, 0)
    if axis < 0:
        return tree.append(nodes, [])
    own, *sides = divided(lattice, nodes, axis, value)
    return tree.append(own, [_cut(lattice, side, steps, leaf_nodes, tree) for side in sides])


def _cut_graph(quotient: Quotient, groups: Index, leaf_nodes: int, tree: _Tree) -> int:
    """Append the fronts of some groups of nodes; returns the number of the last, their root."""
    sizes, nodes = quotient.sizes[groups], quotient.nodes_of(groups)
    if len(nodes) <= leaf_nodes:
        return tree.append(nodes, [])
    graph = quotient.part(groups)
    piece, count = pieces_of(*graph)
    if count > 1:
        own, sides = nodes[:0], [groups[piece == number] for number in range(count)]
    else:
        side = halves(quotient.lattice[groups], sizes, *graph)
        own = quotient.nodes_of(groups[side == BETWEEN])
        sides = [groups[side == each] for each in (BELOW, ABOVE) if (side == each).any()]
    return tree.append(own, [_cut_graph(quotient, side, leaf_nodes, tree) for side in sides])
