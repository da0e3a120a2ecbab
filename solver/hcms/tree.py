"""The merge tree: which subdomains are joined, in which order, and which rank does it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carillon.errors import UserError


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

    def ranges(self) -> list[tuple[int, int]]:
        """Half-open range of subdomains of every group."""
        ranges = [(part, part + 1) for part in range(self.parts)]
        for merge in self.merges:
            ranges.append((ranges[merge.left][0], ranges[merge.right][1]))
        return ranges


def build_tree(cell_nodes_part: NDArray[np.int32]) -> tuple[MergeTree, NDArray[np.int32]]:
    """Merge tree that joins groups with large shared interfaces first, level by level.

    Parameters
    ----------
    cell_nodes_part
        (m, 8) subdomain of every corner of every cell.

    Returns
    -------
    The tree, and the new number (parts,) of each subdomain: leaves of the tree from left to right.
    """
    parts = int(cell_nodes_part.max()) + 1
    shared = _shared_cells(cell_nodes_part, parts)
    groups: dict[int, list[int]] = {part: [part] for part in range(parts)}
    merges: list[tuple[int, int, int]] = []
    following = parts
    while len(groups) > 1:
        names = sorted(groups)
        membership = np.zeros((len(names), parts))
        for row, name in enumerate(names):
            membership[row, groups[name]] = 1.0
        weight = membership @ shared @ membership.T
        merged: dict[int, list[int]] = {}
        for a, b in _heaviest_matching(weight):
            left, right = names[a], names[b]
            merges.append((following, left, right))
            merged[following] = groups.pop(left) + groups.pop(right)
            following += 1
        groups.update(merged)
    order = next(iter(groups.values()))
    renumbered = np.empty(parts, dtype=np.int32)
    renumbered[order] = np.arange(parts, dtype=np.int32)

    def rename(group: int) -> int:
        return int(renumbered[group]) if group < parts else group

    tree = MergeTree(
        parts, tuple(Merge(group, rename(left), rename(right)) for group, left, right in merges)
    )
    return tree, renumbered


def _shared_cells(cell_nodes_part: NDArray[np.int32], parts: int) -> NDArray[np.float64]:
    """Number of cells (parts, parts) that straddle each pair of subdomains."""
    touches = np.zeros((len(cell_nodes_part), parts), dtype=np.float32)
    touches[np.arange(len(touches))[:, None], cell_nodes_part] = 1.0
    straddling = touches[touches.sum(axis=1) > 1]
    shared = (straddling.T @ straddling).astype(float)
    np.fill_diagonal(shared, 0.0)
    return shared


def _heaviest_matching(weight: NDArray[np.float64]) -> list[tuple[int, int]]:
    """Greedy matching by weight; at least one pair even if nothing is shared."""
    size = len(weight)
    first, second = np.triu_indices(size, 1)
    pairs = sorted(zip(-weight[first, second], first, second, strict=True))
    free = np.ones(size, dtype=bool)
    matched: list[tuple[int, int]] = []
    for negative_weight, a, b in pairs:
        if free[a] and free[b] and (negative_weight < 0.0 or not matched):
            free[a] = free[b] = False
            matched.append((int(a), int(b)))
    return matched


def assign_ranks(sizes: NDArray[np.int64], ranks: int) -> NDArray[np.int32]:
    """Owner rank of each subdomain: contiguous ranges of about equal total size, none empty.

    Raises
    ------
    UserError
        If there are more ranks than subdomains.
    """
    parts = len(sizes)
    if ranks > parts:
        raise UserError(
            f"{ranks} ranks for {parts} subdomains: every rank needs one; start at most {parts} "
            f"ranks or pass --subdomains {ranks} or more"
        )
    ends = np.cumsum(sizes)
    owner = np.empty(parts, dtype=np.int32)
    start = 0
    for rank in range(ranks):
        target = ends[-1] * (rank + 1) / ranks
        stop = int(np.searchsorted(ends, target - 0.5 * sizes.mean())) + 1
        stop = min(max(stop, start + 1), parts - (ranks - 1 - rank))
        if rank == ranks - 1:
            stop = parts
        owner[start:stop] = rank
        start = stop
    return owner
