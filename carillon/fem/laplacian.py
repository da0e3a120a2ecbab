"""Volumetric Laplacian of the cells (Xu et al. 2015), and its low eigenvectors.

The cells are the vertices of a graph whose edges are the shared faces; on a uniform grid the graph
Laplacian is the finite-volume Laplacian with natural boundary conditions.  Its low eigenvectors Phi
reduce the material (Y = Phi z, section 6 of the paper) and cut the mesh (section 7.2).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import eigsh

from carillon.fem.geometry.faces import face_neighbours

if TYPE_CHECKING:
    from carillon.fem.geometry import HexMesh

Array = NDArray[np.float64]


def cell_laplacian(mesh: HexMesh) -> sp.csr_matrix:
    """Graph Laplacian (m, m) of the face neighbours: degree on the diagonal, -1 per shared face."""
    pairs = face_neighbours(mesh)
    ones = np.ones(len(pairs))
    adjacency = sp.coo_matrix((ones, (pairs[:, 0], pairs[:, 1])), shape=(mesh.n_cells,) * 2)
    adjacency = (adjacency + adjacency.T).tocsr()
    degree = np.asarray(adjacency.sum(axis=1)).ravel()
    return (sp.diags(degree) - adjacency).tocsr()


def laplacian_modes(mesh: HexMesh, count: int) -> tuple[Array, Array]:
    """The `count` lowest eigenpairs of the cell Laplacian: values (count,), vectors (m, count).

    The first is the constant.  Vectors have unit length and a sign that makes their largest entry
    positive; the start vector is fixed, so the result is the same in every run.

    Examples
    --------
    >>> from carillon.fem.geometry import hexmesh_from_grid
    >>> row = hexmesh_from_grid(np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]]), np.zeros(3), 1.0)
    >>> values, vectors = laplacian_modes(row, 3)
    >>> (values.round(6) + 0.0).tolist(), vectors.shape
    ([0.0, 1.0, 3.0], (3, 3))
    """
    matrix = cell_laplacian(mesh)
    size = mesh.n_cells
    count = min(count, size)
    if size <= max(64, 2 * count + 1):
        values, vectors = np.linalg.eigh(matrix.toarray())
        values, vectors = values[:count], vectors[:, :count]
    else:
        start = np.cos(np.arange(size))
        values, vectors = eigsh(matrix.tocsc(), count, sigma=-1e-3, which="LM", v0=start)
        order = np.argsort(values)
        values, vectors = values[order], vectors[:, order]
    peak = np.abs(vectors).argmax(axis=0)
    vectors = vectors * np.sign(vectors[peak, np.arange(count)])
    return values, vectors
