"""Who owns what: subdomains, merge tree, owner ranks, and the numbering of distributed rows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar, cast

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from solver.geometry import HexMesh
from solver.hcms.tree import MergeTree, assign_ranks, build_tree
from solver.partition import default_subdomains, partition_cells, partition_nodes

T = TypeVar("T")


@dataclass(frozen=True)
class Decomposition:
    """Subdomains of a mesh and their owners; identical on every rank.

    Attributes
    ----------
    tree
        The merge tree, whose leaves are the subdomains from left to right.
    node_part
        (n,) subdomain of each node.
    owner
        (parts,) rank of each subdomain; contiguous.
    order
        (n,) nodes in distributed order: by subdomain, then by number.
    offsets
        (parts + 1,) first row of each subdomain in `order`.
    """

    tree: MergeTree
    node_part: NDArray[np.int32]
    owner: NDArray[np.int32]
    order: NDArray[np.int64]
    offsets: NDArray[np.int64]

    def nodes_of(self, part: int) -> NDArray[np.int64]:
        """Sorted nodes of one subdomain."""
        return self.order[self.offsets[part] : self.offsets[part + 1]]

    def local_range(self, rank: int) -> tuple[int, int]:
        """Half-open range of node rows that `rank` owns in the distributed order."""
        owned = np.flatnonzero(self.owner == rank)
        return int(self.offsets[owned[0]]), int(self.offsets[owned[-1] + 1])

    def group_sizes(self) -> list[int]:
        """Unknowns of every group of the tree."""
        return [
            3 * int(self.offsets[stop] - self.offsets[start]) for start, stop in self.tree.ranges()
        ]

    def sides(self, left: tuple[int, int], right: tuple[int, int]) -> NDArray[np.int8]:
        """1 for nodes in the subdomain range `left`, 2 for `right`, 0 elsewhere; shape (n,)."""
        part = self.node_part
        in_left = (part >= left[0]) & (part < left[1])
        in_right = (part >= right[0]) & (part < right[1])
        return (in_left + 2 * in_right).astype(np.int8)


def decompose(
    mesh: HexMesh, subdomains: int | None = None, seed: int = 0, comm: MPI.Comm = MPI.COMM_WORLD
) -> Decomposition:
    """Cut `mesh` into subdomains, build the merge tree and deal subdomains to the ranks.

    The cut and the tree do not depend on the number of ranks; they are computed once and
    broadcast, so that rounding cannot make ranks disagree.
    """

    def cut() -> tuple[MergeTree, NDArray[np.int32]]:
        parts = subdomains
        if parts is None:
            parts = min(max(default_subdomains(3 * mesh.n_nodes), comm.size), mesh.n_cells)
        node_part = partition_nodes(mesh, partition_cells(mesh, parts, seed))
        tree, renumbered = build_tree(node_part[mesh.cells])
        return tree, renumbered[node_part]

    tree, node_part = on_root(comm, cut)
    order = np.argsort(node_part, kind="stable").astype(np.int64)
    sizes = np.bincount(node_part, minlength=tree.parts)
    offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    return Decomposition(tree, node_part, assign_ranks(sizes, comm.size), order, offsets)


def on_root(comm: MPI.Comm, compute: Callable[[], T]) -> T:
    """Call `compute` on rank 0 and give every rank its result, or its exception."""
    result: T | None = None
    failure: Exception | None = None
    if comm.rank == 0:
        try:
            result = compute()
        except Exception as error:
            failure = error
    result, failure = comm.bcast((result, failure), root=0)
    if failure is not None:
        # Every rank raises it, so that no rank is left waiting for the others.
        raise failure
    return cast(T, result)
