"""Volumetric Laplacian of the cells (Xu et al. 2015), and its low eigenvectors.

The cells are the vertices of a graph whose edges are the shared faces; on a uniform grid the graph
Laplacian is the finite-volume Laplacian with natural boundary conditions.  Its low eigenvectors Phi
reduce the material (Y = Phi z, section 6 of the paper) and cut the mesh (section 7.2).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, eigsh

from carillon.arrays import Array, Index
from carillon.fem.aggregation import COARSEST, Level, levels_of
from carillon.fem.geometry.faces import face_neighbours
from carillon.fem.multigrid import ShiftedInverse
from carillon.processes.threads import blas_threads

if TYPE_CHECKING:
    from carillon.fem.geometry import HexMesh


FEW_CELLS = 12_000
"""Cells up to which the Laplacian is factorised; the factors of more fill up."""
SHIFT = 1e-3
"""Shift at which the Laplacian is inverted; it lies below the spectrum."""
TOLERANCE = 1e-6
"""Relative error of eigenvalues from an iterative inverse."""


@dataclass(frozen=True, eq=False)
class CellGraph:
    """Cells of any sizes, and which of them share a face."""

    grid: Index
    """(m, 3) where they are, in integers."""
    pairs: Index
    """(p, 2)."""

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return len(self.grid)


def cell_laplacian(mesh: HexMesh | CellGraph) -> sp.csr_matrix:
    """Graph Laplacian (m, m) of the face neighbours: degree on the diagonal, -1 per shared face."""
    pairs = mesh.pairs if isinstance(mesh, CellGraph) else face_neighbours(mesh)
    ones = np.ones(len(pairs))
    adjacency = sp.coo_matrix((ones, (pairs[:, 0], pairs[:, 1])), shape=(mesh.n_cells,) * 2)
    adjacency = (adjacency + adjacency.T).tocsr()
    degree = np.asarray(adjacency.sum(axis=1)).ravel()
    return (sp.diags(degree) - adjacency).tocsr()


def laplacian_modes(mesh: HexMesh | CellGraph, count: int) -> tuple[Array, Array]:
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
    count = min(count, mesh.n_cells)
    if mesh.n_cells <= FEW_CELLS:
        values, vectors = _factorised(matrix, count)
    else:
        values, vectors = _iterated(levels_of(matrix, mesh.grid, COARSEST), count)
    peak = np.abs(vectors).argmax(axis=0)
    vectors = vectors * np.sign(vectors[peak, np.arange(count)])
    return values, vectors


def rough_modes(level: Level, count: int) -> tuple[Array, Array]:
    """The `count` lowest eigenpairs of a coarse graph, about those of its cells.

    Vectors (m, count) have unit length over the cells.
    """
    scale = 1.0 / np.sqrt(level.sizes)
    scaled = sp.diags(scale) @ level.laplacian @ sp.diags(scale)
    values, vectors = _factorised(scaled.tocsr(), count)
    return values, scale[:, None] * vectors


def _factorised(matrix: sp.csr_matrix, count: int) -> tuple[Array, Array]:
    size = matrix.shape[0]
    if size <= max(64, 2 * count + 1):
        values, vectors = np.linalg.eigh(matrix.toarray())
        return values[:count], vectors[:, :count]
    return _ascending(
        *eigsh(matrix.tocsc(), count, sigma=-SHIFT, which="LM", v0=np.cos(np.arange(size)))
    )


def _iterated(levels: list[Level], count: int) -> tuple[Array, Array]:
    matrix = levels[0].laplacian
    inverse = ShiftedInverse(levels, SHIFT, 0.1 * TOLERANCE)
    operator = LinearOperator(matrix.shape, matvec=inverse.solve, dtype=float)
    start = np.cos(np.arange(matrix.shape[0]))
    # Threads would add in another order, and wait for each other longer than they add.
    with blas_threads(1):
        return _ascending(
            *eigsh(matrix, count, sigma=-SHIFT, OPinv=operator, v0=start, tol=TOLERANCE)
        )


def _ascending(values: Array, vectors: Array) -> tuple[Array, Array]:
    order = np.argsort(values)
    return values[order], vectors[:, order]
