"""Coarser and coarser graphs of the cells.

Cells that hang together within a 2x2x2 block of the grid are one vertex of the next coarser graph,
so that parts which touch nowhere stay apart.  Values are interpolated as constants (Braess 1995).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from carillon.arrays import Array

DAMPING = 0.7
"""Damping factor of a Jacobi step; it reduces most what differs from vertex to vertex."""
MOST_KEPT = 0.7
"""Share of the vertices beyond which a coarser graph is not worth having."""
COARSEST = 100
"""Fewest vertices of the graph whose matrix a V-cycle inverts; it has up to eight times as many."""


@dataclass(frozen=True)
class Level:
    """A graph whose vertices are one or several cells."""

    laplacian: sp.csr_matrix
    """(m, m) with the number of faces that two vertices share as the weight of their edge."""
    grid: NDArray[np.int32]
    """(m, 3) integer coordinates of the vertices, in edges of this level."""
    sizes: Array
    """(m,) number of cells of each vertex."""
    sums: sp.csr_matrix
    """(finer, m) matrix whose rows tell the vertex of each of the next finer graph; the identity on
    the finest."""

    def __len__(self) -> int:
        return len(self.sizes)

    def coarser(self) -> Level:
        """The graph of the connected parts of blocks."""
        matrix, block = self.laplacian, self.grid >> 1
        row = np.repeat(np.arange(len(self), dtype=np.int32), np.diff(matrix.indptr))
        inside = (block[row] == block[matrix.indices]).all(axis=1)
        ends = row[inside], matrix.indices[inside]
        graph = sp.csr_matrix((np.ones(len(ends[0]), dtype=np.int8), ends), shape=matrix.shape)
        count, vertex = connected_components(graph, directed=False)
        rows = np.ones(len(self)), vertex, np.arange(len(self) + 1)
        sums = sp.csr_matrix(rows, shape=(len(self), count))
        grid = np.empty((count, 3), dtype=np.int32)
        grid[vertex] = block
        return Level((sums.T @ matrix @ sums).tocsr(), grid, sums.T @ self.sizes, sums)

    def smoothed(self, values: Array, steps: int) -> Array:
        """Values (m, k) after Jacobi steps that even them out between neighbours."""
        diagonal = self.laplacian.diagonal()
        # A vertex without neighbours has nothing to be evened out with.
        scale = np.divide(DAMPING, diagonal, out=np.zeros_like(diagonal), where=diagonal > 0.0)
        for _ in range(steps):
            values = values - scale[:, None] * (self.laplacian @ values)
        return values


def levels_of(laplacian: sp.csr_matrix, grid: NDArray[np.integer], fewest: int) -> list[Level]:
    """The graph of the cells at `grid` (m, 3), and coarser ones of `fewest` vertices or more.

    Examples
    --------
    >>> row = sp.csr_matrix(np.diag([1.0, 2, 2, 1]) - np.eye(4, k=1) - np.eye(4, k=-1))
    >>> grid = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]])
    >>> coarse = levels_of(row, grid, 2)[-1]
    >>> coarse.sums.indices.tolist(), coarse.sizes.tolist(), coarse.laplacian.toarray().tolist()
    ([0, 0, 1, 1], [2.0, 2.0], [[1.0, -1.0], [-1.0, 1.0]])
    """
    alone = sp.identity(len(grid), format="csr")
    levels = [Level(laplacian, np.asarray(grid, dtype=np.int32), np.ones(len(grid)), alone)]
    while len(levels[-1]) > fewest:
        coarser = levels[-1].coarser()
        if len(coarser) < fewest or len(coarser) > MOST_KEPT * len(levels[-1]):
            break
        levels.append(coarser)
    return levels
