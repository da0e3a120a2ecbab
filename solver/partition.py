"""Cutting the mesh into subdomains: k-means++ on low Laplacian eigenvectors (section 7.2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sklearn.cluster import KMeans

from carillon.errors import UserError
from solver.geometry import HexMesh
from solver.laplacian import laplacian_modes

EMBEDDING_MODES = 12
"""Laplacian eigenvectors that span the clustering space, the constant left out."""
SUBDOMAIN_DOFS = 1800
"""Aimed unknowns of a subdomain."""
FEWEST_SUBDOMAINS = 4
"""Subdomains of the smallest models, so that a few ranks can share them."""


def default_subdomains(n_dofs: int) -> int:
    """Number of subdomains for a model of `n_dofs` unknowns; independent of the number of ranks."""
    return max(FEWEST_SUBDOMAINS, round(n_dofs / SUBDOMAIN_DOFS))


def partition_cells(mesh: HexMesh, parts: int, seed: int = 0) -> NDArray[np.int32]:
    """Subdomain (m,) of each cell, by k-means++ in the space of Laplacian eigenvectors."""
    if not 1 <= parts <= mesh.n_cells:
        raise UserError(
            f"{parts} subdomains asked for a mesh of {mesh.n_cells:,} cells; "
            f"expected 1 to {mesh.n_cells:,}"
        )
    if parts == 1:
        return np.zeros(mesh.n_cells, dtype=np.int32)
    values, vectors = laplacian_modes(mesh, EMBEDDING_MODES + 1)
    # Commute-time weights: distances in the embedding follow distances along the solid.
    embedding = vectors[:, 1:] / np.sqrt(np.maximum(values[1:], 1e-12))
    labels = KMeans(parts, init="k-means++", n_init=1, random_state=seed).fit_predict(embedding)
    _, labels = np.unique(labels, return_inverse=True)
    return labels.astype(np.int32)


def partition_nodes(mesh: HexMesh, cell_part: NDArray[np.int32]) -> NDArray[np.int32]:
    """Subdomain (n,) of each node: the part that most of its cells belong to, ties to the lower."""
    parts = int(cell_part.max()) + 1
    node = mesh.cells.ravel().astype(np.int64)
    votes = np.bincount(node * parts + np.repeat(cell_part, 8), minlength=mesh.n_nodes * parts)
    node_part = votes.reshape(mesh.n_nodes, parts).argmax(axis=1)
    _, node_part = np.unique(node_part, return_inverse=True)
    return node_part.astype(np.int32)
