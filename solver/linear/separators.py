"""Nodes that separate the ranks: where their rows meet, halves of the ranks by halves.

The ranks are halved until each is alone.  The nodes between two halves are eliminated after all
rows of either, by the ranks of both; so the inside of every rank's rows is its own to eliminate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from carillon.arrays import Index
from solver.assembly.system import Layout
from solver.distribution.collective import bcast_from_root, gather_rows
from solver.distribution.rank_groups import RankGroup, groups_of


@dataclass(frozen=True)
class Separators:
    """The separating nodes of all groups, the same on every rank."""

    groups: list[RankGroup]
    """Halves before what they are halves of."""
    nodes: Index
    """Distributed numbers of the nodes in the order of elimination: those of the first group, of
    the next, and so on, ascending within a group."""
    offsets: Index
    """(groups + 1,) first node of each group in `nodes`."""

    @classmethod
    def of_layout(cls, layout: Layout) -> Separators:
        """Separators of the rows of a layout, as few nodes as cut all connections; collective."""
        comm, pattern = layout.comm, layout.pattern
        row = np.repeat(np.arange(pattern.start, pattern.stop), np.diff(pattern.indptr))
        column = pattern.global_columns
        # The ranks after this one; those before it know of the others.
        outward = column >= pattern.stop
        edges = gather_rows(comm, np.stack([row[outward], column[outward]], axis=1))
        groups = list(groups_of(0, comm.size))
        decomposition = layout.local_mesh.decomposition
        stops = [decomposition.local_range(rank)[1] for rank in range(comm.size)]

        def found() -> list[Index]:
            assert edges is not None
            return _separators(edges, np.array(stops), groups)

        nodes = bcast_from_root(comm, found)
        none = np.empty(0, dtype=np.int64)
        offsets = np.concatenate([[0], np.cumsum([len(each) for each in nodes])]).astype(np.int64)
        return cls(groups, np.concatenate([none, *nodes]), offsets)

    def path(self, rank: int) -> list[int]:
        """Numbers of the groups that `rank` is in, from the smallest to that of all ranks."""
        return [number for number, group in enumerate(self.groups) if rank in group]

    def group_of(self, places: Index) -> Index:
        """Number of the group that each place in `nodes` belongs to; -1 for place -1."""
        return np.searchsorted(self.offsets, places, side="right") - 1

    def places(self, *parts: Index) -> Index:
        """Place of each node in `nodes` of the separators, -1 for those inside a rank's rows.

        The nodes may be given in several parts.
        """
        nodes = np.concatenate(parts)
        order = np.argsort(self.nodes)
        if not len(order):
            return np.full(len(nodes), -1, dtype=np.int64)
        place = order[np.minimum(np.searchsorted(self.nodes, nodes, sorter=order), len(order) - 1)]
        return np.where(self.nodes[place] == nodes, place, -1)


def _separators(edges: Index, stops: Index, groups: list[RankGroup]) -> list[Index]:
    """Separating nodes of each group, ascending, from the edges (e, 2) between ranks."""
    owners = np.searchsorted(stops, edges, side="right")
    result: list[Index] = []
    # The largest groups first: what separates them is cut already for their halves.
    for group in reversed(groups):
        left, right = owners.T
        within = (left >= group.first) & (right < group.stop)
        across = within & (left < group.middle) & (right >= group.middle)
        cover = smallest_cover(edges[across])
        open_ends = ~np.isin(edges, cover).any(axis=1)
        edges, owners = edges[open_ends], owners[open_ends]
        result.append(cover)
    return result[::-1]


def smallest_cover(edges: Index) -> Index:
    """Fewest nodes, ascending, of which every edge (e, 2) between two sets has one.

    As many as the largest flow through the edges carries, where a node carries one (Koenig 1931).

    Examples
    --------
    >>> smallest_cover(np.array([[0, 10], [1, 10], [2, 10], [2, 11], [2, 12]]))
    array([ 2, 10])
    """
    if not len(edges):
        return np.empty(0, dtype=np.int64)
    left, row = np.unique(edges[:, 0], return_inverse=True)
    right, column = np.unique(edges[:, 1], return_inverse=True)
    source, sink = len(left) + len(right), len(left) + len(right) + 1
    starts = np.concatenate([np.full(len(left), source), row, len(left) + np.arange(len(right))])
    ends = np.concatenate([np.arange(len(left)), len(left) + column, np.full(len(right), sink)])
    ones = np.ones(len(starts), dtype=np.int32)
    network = sp.csr_matrix((ones, (starts, ends)), shape=(sink + 1, sink + 1))
    flow = maximum_flow(network, source, sink).flow
    # What more could flow to from the source: its nodes on the left need no cover.
    more = network - flow
    more.data = (more.data > 0).astype(np.int8)
    more.eliminate_zeros()
    reached = breadth_first_order(more, source, return_predecessors=False)
    reached_left = np.zeros(len(left), dtype=bool)
    reached_left[reached[reached < len(left)]] = True
    on_right = reached[(reached >= len(left)) & (reached < source)] - len(left)
    return np.sort(np.concatenate([left[~reached_left], right[on_right]]))
