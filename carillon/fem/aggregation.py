"""Coarser and coarser graphs of the cells, and an inverse of the Laplacian by multigrid on them.

Cells that hang together within a 2x2x2 block of the grid are one vertex of the next coarser graph,
so that parts which touch nowhere stay apart.  Values are interpolated as constants (Braess 1995).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import LinearOperator, cg

from carillon.arrays import Array
from carillon.errors import LocalConvergenceError

DAMPING = 0.7
"""Damping factor of a Jacobi step; it reduces most what differs from vertex to vertex."""
STEPS = 2
"""Jacobi steps before and after each coarse correction."""
OVERCORRECTION = 1.6
"""Factor of coarse corrections: between constants the coarse graph is up to twice too stiff."""
MOST_KEPT = 0.7
"""Share of the vertices beyond which a coarser graph is not worth having."""
COARSEST = 100
"""Fewest vertices of the graph whose matrix a V-cycle inverts; it has up to eight times as many."""
MOST_ITERATIONS = 200
"""Most iterations of conjugate gradients; some twenty are usual."""
CYCLE = np.float32
"""Numbers of the cycle: precise enough for a preconditioner, and half the traffic of memory."""


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


class ShiftedInverse:
    """(L + shift)^-1 by conjugate gradients with a V-cycle.

    Parameters
    ----------
    levels
        The finest is that of L; the matrix of the coarsest is inverted.
    shift
        Positive.
    tolerance
        Norm of the residual, relative to that of the right-hand side.
    """

    def __init__(self, levels: list[Level], shift: float, tolerance: float) -> None:
        self._tolerance = tolerance
        matrices = [(level.laplacian + shift * sp.diags(level.sizes)).tocsr() for level in levels]
        self._matrix = matrices[0]
        self._inverse = np.linalg.inv(matrices[-1].toarray()).astype(CYCLE)
        self._matrices = [matrix.astype(CYCLE) for matrix in matrices[:-1]]
        self._scales = [CYCLE(DAMPING) / matrix.diagonal() for matrix in self._matrices]
        self._sums = [level.sums.astype(CYCLE) for level in levels[1:]]
        self._restrictions = [sums.T.tocsr() for sums in self._sums]

    def solve(self, rhs: Array) -> Array:
        """Solution (m,) for a right-hand side.

        Raises LocalConvergenceError if `MOST_ITERATIONS` do not reach the tolerance.
        """
        matrix = self._matrix

        def cycled(rhs: Array) -> Array:
            return self._cycle(rhs.astype(CYCLE), 0).astype(float)

        cycle = LinearOperator(matrix.shape, matvec=cycled, dtype=float)
        solution, missed = cg(
            matrix, rhs, rtol=self._tolerance, atol=0.0, maxiter=MOST_ITERATIONS, M=cycle
        )
        if missed:
            raise LocalConvergenceError(
                f"the Laplacian of {len(rhs):,} cells missed a residual of {self._tolerance:g} in "
                f"{MOST_ITERATIONS} iterations"
            )
        return np.asarray(solution)

    def _cycle(self, rhs: NDArray[np.float32], number: int) -> NDArray[np.float32]:
        if number == len(self._sums):
            return np.asarray(self._inverse @ rhs)
        matrix, scale = self._matrices[number], self._scales[number]
        values = scale * rhs
        for _ in range(STEPS - 1):
            values += scale * (rhs - matrix @ values)
        coarse = self._cycle(self._restrictions[number] @ (rhs - matrix @ values), number + 1)
        values += CYCLE(OVERCORRECTION) * (self._sums[number] @ coarse)
        for _ in range(STEPS):
            values += scale * (rhs - matrix @ values)
        return values
