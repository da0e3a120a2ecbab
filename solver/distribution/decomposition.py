"""Who owns what: subdomains, merge tree, owner ranks, and the numbering of distributed rows."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Index
from carillon.fem.model import Solid
from solver.distribution.graph_halves import cut_graph
from solver.distribution.halves import cut_by_planes
from solver.distribution.node_graph import graph_of_cells
from solver.distribution.partition import default_subdomains, partition_model
from solver.distribution.planes import lattice_of
from solver.distribution.tree import MergeTree, assign_ranks, build_tree, tree_of_halves

COST_EXPONENT = 1.5
"""Work on a subdomain grows like this power of its unknowns: so many modes of so many unknowns."""


@dataclass(frozen=True)
class Decomposition:
    """Subdomains and their owners: small, and identical on every rank.

    Nodes are numbered by subdomain; the number of a node in this order is its row.
    """

    tree: MergeTree
    """The merge tree, whose leaves are the subdomains from left to right."""
    owner: NDArray[np.int32]
    """(parts,) rank of each subdomain; contiguous."""
    offsets: Index
    """(parts + 1,) first row of each subdomain."""

    @property
    def n_nodes(self) -> int:
        """Number of nodes of the whole mesh."""
        return int(self.offsets[-1])

    def subdomains_of(self, rank: int) -> range:
        """Subdomains that `rank` owns."""
        first, last = np.searchsorted(self.owner, [rank, rank + 1])
        return range(int(first), int(last))

    def local_range(self, rank: int) -> tuple[int, int]:
        """Half-open range of rows that `rank` owns."""
        owned = self.subdomains_of(rank)
        return int(self.offsets[owned.start]), int(self.offsets[owned.stop])

    def row_ranges(self) -> list[tuple[int, int]]:
        """Half-open range of rows of every group of the tree."""
        return [
            (int(self.offsets[start]), int(self.offsets[stop]))
            for start, stop in self.tree.ranges()
        ]


def decompose(
    model: Solid, subdomains: int | None = None, seed: int = 0, ranks: int = 1
) -> tuple[Decomposition, Index]:
    """Cut a solid into subdomains, build the merge tree and deal subdomains to the ranks.

    The cut and the tree depend on the number of ranks only where there are more ranks than
    subdomains by default. Returns the decomposition and the nodes (n,) in its order: by subdomain,
    then by number. Raises UserError if there are more subdomains than cells, or more ranks than
    subdomains.
    """
    node_part = _partition(model, subdomains, seed, ranks)
    tree, renumbered = build_tree(node_part[model.connectivity], np.bincount(node_part))
    order, offsets = _rows(renumbered[node_part], tree.parts)
    owner = assign_ranks(np.diff(offsets).astype(float) ** COST_EXPONENT, ranks)
    return Decomposition(tree, owner, offsets), order


def decompose_by_planes(model: Solid, ranks: int) -> tuple[Decomposition, Index]:
    """Cut a solid into one subdomain a rank, of equal work, by planes of its lattice.

    Few nodes lie in the planes: what is left to the ranks together is little.  Returns what
    `decompose` does. Raises UserError if there are more ranks than nodes.
    """
    mesh, elements = model.mesh, model.elements
    lattice = lattice_of(model.positions, mesh.origin, elements.edge)
    if elements.steps is not None:
        part = cut_by_planes(lattice, ranks, elements.steps)
    else:
        cells, count = model.connectivity.astype(np.int64), len(lattice)
        indptr, indices, _ = graph_of_cells(cells, count, count)
        part = cut_graph(lattice, indptr, indices, ranks)
    order, offsets = _rows(part, ranks)
    return Decomposition(tree_of_halves(ranks), np.arange(ranks, dtype=np.int32), offsets), order


def _rows(node_part: NDArray[np.int32], parts: int) -> tuple[Index, Index]:
    """Nodes (n,) by subdomain, then by number, and the first row (parts + 1,) of each subdomain."""
    sizes = np.bincount(node_part, minlength=parts)
    offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    return np.argsort(node_part, kind="stable").astype(np.int64), offsets


def _partition(model: Solid, subdomains: int | None, seed: int, ranks: int) -> NDArray[np.int32]:
    """Subdomain (n,) of each node; as many as the ranks at least, unless told how many."""
    if subdomains is not None:
        return partition_model(model, subdomains, seed)
    elements = len(model.connectivity)
    asked = min(max(default_subdomains(model.n_dofs), ranks), elements)
    while True:
        node_part = partition_model(model, asked, seed)
        # Parts of a few cells may lose all their nodes to their neighbours.
        missing = ranks - int(node_part.max()) - 1
        if missing <= 0 or asked == elements:
            return node_part
        asked = min(asked + missing, elements)
