"""Cutting the mesh into subdomains: k-means++ on low Laplacian eigenvectors (section 7.2)."""

import warnings

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index
from carillon.errors import UserError
from carillon.fem.aggregation import levels_of
from carillon.fem.geometry import HexMesh
from carillon.fem.laplacian import (
    FEW_CELLS,
    CellGraph,
    cell_laplacian,
    laplacian_modes,
    rough_modes,
)
from carillon.fem.model import Solid
from carillon.processes.threads import one_thread

EMBEDDING_MODES = 12
"""Laplacian eigenvectors that span the clustering space, the constant left out."""
SUBDOMAIN_DOFS = 1800
"""Number of unknowns that a subdomain should have."""
FEWEST_SUBDOMAINS = 4
"""Number of subdomains of the smallest models, so that a few ranks can share them."""
FEW_CLUSTERS = 16
"""Largest number of subdomains that SciPy's k-means finds."""
ITERATIONS, TRIES = 20, 4
"""Iterations and tries of SciPy's k-means, whose seeding is not greedy. The best try counts."""
FEWEST_POINTS, FEWEST_VERTICES = 10, 1000
"""Least number of vertices of the coarsest graph that is clustered, for each subdomain and
altogether."""
SMOOTHINGS, FURTHER_ITERATIONS = 3, 2
"""Jacobi steps of the eigenvectors, and iterations of k-means, on each finer graph."""
FEWEST_HOLDING = 3
"""Least number of corners of a cell in a subdomain for the cell to hold them together."""
MOST_ROUNDS = 10
"""Largest number of rounds in which pieces of subdomains join their neighbours."""


def default_subdomains(n_dofs: int) -> int:
    """Number of subdomains for a model of `n_dofs` unknowns; independent of the number of ranks."""
    return max(FEWEST_SUBDOMAINS, round(n_dofs / SUBDOMAIN_DOFS))


def partition_cells(mesh: HexMesh | CellGraph, parts: int, seed: int = 0) -> NDArray[np.int32]:
    """Subdomain (m,) of each cell, by k-means++ in the space of Laplacian eigenvectors."""
    if not 1 <= parts <= mesh.n_cells:
        raise UserError(
            f"{parts} subdomains asked for a mesh of {mesh.n_cells:,} cells; "
            f"expected 1 to {mesh.n_cells:,}"
        )
    if parts == 1:
        return np.zeros(mesh.n_cells, dtype=np.int32)
    if mesh.n_cells > FEW_CELLS:
        # On one thread, since several would add in any order.
        with one_thread():
            return _without_gaps(_refined_clusters(mesh, parts, seed))
    values, vectors = laplacian_modes(mesh, EMBEDDING_MODES + 1)
    return _without_gaps(_clusters(_embedding(values, vectors), parts, seed))


def _embedding(values: Array, vectors: Array) -> Array:
    """Points (m, d) by commute-time weights: their distances follow those along the solid."""
    return vectors[:, 1:] / np.sqrt(np.maximum(values[1:], 1e-12))


def _clusters(points: Array, count: int, seed: int) -> NDArray[np.integer]:
    """Cluster (n,) of each point (n, d) by k-means++ (Arthur & Vassilvitskii 2007).

    SciPy's where they are few: to load scikit-learn takes longer than to solve a small model.
    scikit-learn's where they are many, since SciPy's seeding takes time like their square.
    """
    if count <= FEW_CLUSTERS:
        from scipy.cluster.vq import kmeans2

        rng, tries = np.random.default_rng(seed), []
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # an empty cluster does no harm
            for _ in range(TRIES):
                centres, labels = kmeans2(points, count, ITERATIONS, minit="++", rng=rng)
                tries.append((float(np.square(points - centres[labels]).sum()), labels))
        return np.asarray(min(tries, key=lambda each: each[0])[1])
    from sklearn.cluster import KMeans

    kmeans = KMeans(count, init="k-means++", n_init=1, random_state=seed % 2**32)
    return np.asarray(kmeans.fit_predict(points))


def _refined_clusters(mesh: HexMesh | CellGraph, count: int, seed: int) -> NDArray[np.integer]:
    """Cluster (m,) of each cell of a large mesh, found on a coarse graph of the cells first.

    There are the eigenvectors and the clusters; on finer graphs both are but smoothed.
    """
    from sklearn.cluster import KMeans

    levels = levels_of(cell_laplacian(mesh), mesh.grid, max(FEWEST_POINTS * count, FEWEST_VERTICES))
    points = _embedding(*rough_modes(levels[-1], EMBEDDING_MODES + 1))
    kmeans = KMeans(count, init="k-means++", n_init=TRIES, random_state=seed % 2**32)
    kmeans.fit(points, sample_weight=levels[-1].sizes)
    for level, coarser in zip(levels[-2::-1], levels[:0:-1]):
        points = level.smoothed(coarser.sums @ points, SMOOTHINGS)
        kmeans = KMeans(count, init=kmeans.cluster_centers_, n_init=1, max_iter=FURTHER_ITERATIONS)
        kmeans.fit(points, sample_weight=level.sizes)
    return np.asarray(kmeans.labels_)


def partition_nodes(
    cells: NDArray[np.integer], n_nodes: int, cell_part: NDArray[np.int32]
) -> NDArray[np.int32]:
    """Subdomain (n,) of each node: the part that most of its cells belong to, ties to the lower.

    `cells` (c, k) are the nodes of each cell.

    Parts that get no node vanish, and the others are numbered without gaps.
    """
    parts = int(cell_part.max()) + 1
    node = cells.ravel().astype(np.int64)
    pair, votes = np.unique(node * parts + np.repeat(cell_part, cells.shape[1]), return_counts=True)
    voter, part = np.divmod(pair, parts)
    order = np.lexsort([part, -votes, voter])
    first = np.searchsorted(voter[order], np.arange(n_nodes))
    return _without_gaps(part[order][first])


def partition_model(model: Solid, parts: int, seed: int = 0) -> NDArray[np.int32]:
    """Subdomain (n,) of each node: about `parts` connected sets, numbered without gaps, none empty.

    Raises UserError if there are more parts than cells.
    """
    cells, n_nodes = model.connectivity, model.n_nodes
    node_part = partition_nodes(cells, n_nodes, partition_cells(model.graph, parts, seed))
    return connect_subdomains(cells, node_part, n_nodes / (2.0 * parts))


def connect_subdomains(
    cells: NDArray[np.integer], node_part: NDArray[np.int32], smallest: float
) -> NDArray[np.int32]:
    """Subdomains (n,) that hang together, from ones that may not.

    Of a subdomain in pieces the largest stays.  Another piece becomes a subdomain of its own if it
    has `smallest` nodes or more, and is given to the neighbour it shares most corners of cells with
    otherwise.

    Notes
    -----
    What is left after `MOST_ROUNDS` may still be in pieces; such a subdomain has more than six
    rigid motions, which `solver.hcms.local` keeps.
    """
    for _ in range(MOST_ROUNDS):
        piece = subdomain_pieces(cells, node_part)
        sizes = np.bincount(piece)
        owner = np.empty(len(sizes), dtype=np.int64)
        owner[piece] = node_part
        by_size = np.lexsort([-sizes, owner])
        is_largest = np.zeros(len(sizes), dtype=bool)
        is_largest[by_size[np.unique(owner[by_size], return_index=True)[1]]] = True
        if is_largest.all():
            break
        target = _closest_neighbours(cells, node_part, piece, ~is_largest)
        own = ~is_largest & ((sizes >= smallest) | (target < 0))
        target[is_largest] = owner[is_largest]
        target[own] = owner.max() + 1 + np.arange(own.sum())
        node_part = _without_gaps(target[piece])
    return node_part


def subdomain_pieces(cells: NDArray[np.integer], node_part: NDArray[np.int32]) -> Index:
    """Number (n,) of the piece that each node belongs to; a piece lies in one subdomain.

    Nodes of a subdomain hang together if a cell has `FEWEST_HOLDING` of them or more: fewer hold
    each other by a spring at most.
    """
    return _pieces(cells, node_part, FEWEST_HOLDING)


@numba.njit(cache=True, nogil=True)
def _pieces(cells, node_part, fewest):  # type: ignore[no-untyped-def]
    above = np.arange(len(node_part))
    for cell in range(len(cells)):
        nodes = cells[cell]
        for a in range(len(nodes)):
            part, held, is_first = node_part[nodes[a]], 0, True
            for b in range(len(nodes)):
                same = node_part[nodes[b]] == part
                held += same
                is_first &= not (same and b < a)
            if not is_first or held < fewest:
                continue
            for b in range(a + 1, len(nodes)):
                if node_part[nodes[b]] == part:
                    _join(above, nodes[a], nodes[b])
    piece = np.empty(len(node_part), dtype=np.int64)
    count = 0
    for node in range(len(node_part)):
        # A piece is numbered at its first node, which is the root of the others.
        root = _root(above, node)
        if root == node:
            piece[node] = count
            count += 1
        else:
            piece[node] = piece[root]
    return piece


@numba.njit(cache=True, nogil=True)
def _root(above, node):  # type: ignore[no-untyped-def]
    while above[node] != node:
        above[node] = above[above[node]]
        node = above[node]
    return node


@numba.njit(cache=True, nogil=True)
def _join(above, left, right):  # type: ignore[no-untyped-def]
    left, right = _root(above, left), _root(above, right)
    above[max(left, right)] = min(left, right)


def _closest_neighbours(
    cells: NDArray[np.integer], node_part: NDArray[np.int32], piece: Index, asked: Flags
) -> Index:
    """Other subdomain that shares most corners of cells with each piece that is `asked` about.

    -1 without one, and for the other pieces.
    """
    cells = cells[asked[piece][cells].any(axis=1)]
    part = node_part[cells]
    ours, theirs = part[:, :, None], part[:, None, :]
    pairs = (ours != theirs) & asked[piece[cells]][:, :, None]
    seen = np.broadcast_to(piece[cells][:, :, None], pairs.shape)[pairs]
    other = np.broadcast_to(theirs, pairs.shape)[pairs].astype(np.int64)
    parts = int(node_part.max()) + 1
    pair, votes = np.unique(seen * parts + other, return_counts=True)
    voter, candidate = np.divmod(pair, parts)
    order = np.lexsort([candidate, -votes, voter])
    voters, first = np.unique(voter[order], return_index=True)
    closest = np.full(len(asked), -1, dtype=np.int64)
    closest[voters] = candidate[order][first]
    return closest


def _without_gaps(labels: NDArray[np.integer]) -> NDArray[np.int32]:
    return np.unique(labels, return_inverse=True)[1].ravel().astype(np.int32)
