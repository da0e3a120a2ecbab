"""The merge tree: which subdomains are joined, in which order, and which rank does it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from carillon.arrays import Array, Flags, Index
from carillon.errors import UserError
from solver.distribution.rank_groups import groups_of

LIGHTEST = 0.4
"""Least share of the nodes of two partners in the lighter one."""
LIGHTEST_CONNECTED = 0.25
"""Least share in the lighter one where only so uneven a cut leaves both connected."""
EIGENVECTORS = 3
"""Number of eigenvectors of the graph of the subdomains that give cuts."""
_HALVINGS = 50


@dataclass(frozen=True)
class Merge:
    """Join of the groups `left` and `right` into the group `group`."""

    group: int
    left: int
    right: int


@dataclass(frozen=True)
class MergeTree:
    """Binary tree over the subdomains 0..parts-1; group `parts + i` is made by `merges[i]`.

    A child's merge always comes before its parent's.  Subdomains are numbered so that every group
    is a contiguous range of them, which lets ranks own contiguous ranges too.
    """

    parts: int
    merges: tuple[Merge, ...]

    def levels(self) -> list[int]:
        """Level of every group: 0 for subdomains, one more than the higher child for a merge."""
        levels = [0] * self.parts
        for merge in self.merges:
            levels.append(1 + max(levels[merge.left], levels[merge.right]))
        return levels

    def ranges(self) -> list[tuple[int, int]]:
        """Half-open range of subdomains of every group."""
        ranges = [(part, part + 1) for part in range(self.parts)]
        for merge in self.merges:
            ranges.append((ranges[merge.left][0], ranges[merge.right][1]))
        return ranges


def build_tree(
    corner_part: NDArray[np.int32], sizes: NDArray[np.integer]
) -> tuple[MergeTree, NDArray[np.int32]]:
    """Merge tree whose partners are of comparable size and share large interfaces low in the tree.

    The subdomains are bisected recursively where they share few cells: what is cut first is merged
    last. Returns the tree, and the new number (parts,) of each subdomain: leaves of the tree from
    left to right.

    Parameters
    ----------
    corner_part
        (m, k) subdomain of every node of every cell.
    sizes
        (parts,) nodes of every subdomain.

    Notes
    -----
    The lighter of two partners has at least `LIGHTEST_CONNECTED` of their nodes where subdomains
    are small enough, and is as heavy as the spectral order allows otherwise; so the number of
    levels grows with the logarithm of the number of subdomains unless their sizes differ widely.
    """
    parts = len(sizes)
    shared = shared_cells(corner_part, parts)
    leaves: list[int] = []
    joins: list[_Branch] = []

    def grow(members: Index) -> _Branch:
        if len(members) == 1:
            leaves.append(int(members[0]))
            return _Branch(group=len(leaves) - 1)
        left = _bisect(shared[members][:, members], sizes[members].astype(float))
        branch = _Branch((grow(members[left]), grow(members[~left])))
        joins.append(branch)
        return branch

    grow(np.arange(parts))
    joins.sort(key=lambda branch: branch.height)
    merges = []
    for group, branch in enumerate(joins, start=parts):
        branch.group = group
        left, right = branch.children
        merges.append(Merge(group, left.group, right.group))
    renumbered = np.empty(parts, dtype=np.int32)
    renumbered[leaves] = np.arange(parts, dtype=np.int32)
    return MergeTree(parts, tuple(merges)), renumbered


def tree_of_halves(parts: int) -> MergeTree:
    """Merge tree that halves the subdomains as `groups_of` halves the ranks.

    Examples
    --------
    >>> tree_of_halves(3).merges
    (Merge(group=3, left=0, right=1), Merge(group=4, left=3, right=2))
    """
    number = {(part, part + 1): part for part in range(parts)}
    merges = []
    for group in groups_of(0, parts):
        first, middle, stop = group.first, group.middle, group.stop
        number[first, stop] = len(number)
        merges.append(Merge(number[first, stop], number[first, middle], number[middle, stop]))
    return MergeTree(parts, tuple(merges))


class _Branch:
    """A group while the tree grows: a subdomain, or the join of two others."""

    def __init__(self, children: tuple[_Branch, ...] = (), group: int = -1) -> None:
        self.children = children
        self.group = group
        self.height: int = 1 + max((child.height for child in children), default=-1)


def shared_cells(corner_part: NDArray[np.int32], parts: int) -> sp.csr_matrix:
    """Number of cells (parts, parts) that straddle each pair of subdomains; zero diagonal."""
    mixed = corner_part[(corner_part != corner_part[:, :1]).any(axis=1)].astype(np.int64)
    cell = np.arange(len(mixed))[:, None]
    cell, part = np.divmod(np.unique(cell * parts + mixed), parts)
    touches = sp.csr_matrix((np.ones(len(cell)), (cell, part)), shape=(len(mixed), parts))
    shared = (touches.T @ touches).tocsr()
    shared.setdiag(0.0)
    return shared


def _bisect(weight: sp.csr_matrix, sizes: Array) -> Flags:
    """One side (k,), the first member's, of a light and even cut through a graph of k members.

    Members are taken in the order of each of the graph's lowest eigenvectors, and cut where the
    edges of summed `weight` (k, k) are least: first among the cuts that leave `LIGHTEST` of the
    `sizes` on either side and both sides connected, then among less even ones, then among the most
    even of all.
    """
    cuts = _cuts(weight.toarray(), sizes)
    fewest = max(2, _pieces(weight))
    for least in (LIGHTEST, LIGHTEST_CONNECTED):
        for cut in cuts:
            left, right = cut.left, cut.right
            if cut.evenness < least:
                continue
            if _pieces(weight[left][:, left]) + _pieces(weight[right][:, right]) <= fewest:
                return cut.side()
    even = min(LIGHTEST, max(cut.evenness for cut in cuts))
    return next(cut.side() for cut in cuts if cut.evenness >= even)


@dataclass(frozen=True)
class _Cut:
    """Two sides of a graph, the edges between them, and the share of the lighter one."""

    left: Index
    right: Index
    edges: float
    evenness: float

    def side(self) -> Flags:
        """Mask of the members on the side of the first."""
        side = np.zeros(len(self.left) + len(self.right), dtype=bool)
        side[self.left] = True
        return side if side[0] else ~side


def _cuts(weight: Array, sizes: Array) -> list[_Cut]:
    """Cuts through the orders of the graph's lowest eigenvectors, those of fewest edges first."""
    degree = weight.sum(axis=1)
    _, vectors = np.linalg.eigh(np.diag(degree) - weight)
    cuts = []
    for vector in vectors.T[1 : 1 + EIGENVECTORS]:
        order = np.argsort(vector, kind="stable")
        # One more member on the left cuts its edges to the right and heals those to the left.
        healed = np.tril(weight[order][:, order], -1).sum(axis=1)
        edges = np.cumsum(degree[order] - 2.0 * healed)
        share = np.cumsum(sizes[order]) / sizes.sum()
        for stop in range(1, len(order)):
            evenness = min(share[stop - 1], 1.0 - share[stop - 1])
            cuts.append(_Cut(order[:stop], order[stop:], edges[stop - 1], evenness))
    return sorted(cuts, key=lambda cut: cut.edges)


def _pieces(graph: sp.csr_matrix) -> int:
    return int(connected_components(graph, directed=False, return_labels=False))


def assign_ranks(costs: Array, ranks: int) -> NDArray[np.int32]:
    """Owner rank of each subdomain: contiguous ranges, none empty, the costliest least so.

    Raises UserError if there are more ranks than subdomains.

    Examples
    --------
    >>> assign_ranks(np.array([1.0, 1.0, 1.0, 3.0, 2.0]), 3)
    array([0, 0, 0, 1, 2], dtype=int32)
    """
    parts = len(costs)
    if ranks > parts:
        raise UserError(
            f"{ranks} ranks for {parts} subdomains: every rank needs one; start at most {parts} "
            f"ranks or pass --subdomains {ranks} or more"
        )
    ends = np.concatenate([[0.0], np.cumsum(costs)])
    low, high = max(float(costs.max()), ends[-1] / ranks), float(ends[-1])
    best = _filled(ends, ranks, high)
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        stops = _filled(ends, ranks, middle)
        if stops[-1] == parts:
            best, high = stops, middle
        else:
            low = middle
    counts = np.diff([0, *best[:-1], parts])
    return np.repeat(np.arange(ranks, dtype=np.int32), counts)


def _filled(ends: Array, ranks: int, limit: float) -> list[int]:
    """End of each rank's range when every rank takes as much as `limit`, leaving one each."""
    stops: list[int] = []
    stop = 0
    for rank in range(ranks):
        fitting = int(np.searchsorted(ends, ends[stop] + limit, side="right")) - 1
        stop = min(max(fitting, stop + 1), len(ends) - ranks + rank)
        stops.append(stop)
    return stops
