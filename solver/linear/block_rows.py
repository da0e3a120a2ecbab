"""A rank's rows of any PETSc matrix in 3x3 blocks, and their products with row-major blocks."""

from typing import Any

import numba
import numpy as np
import scipy.sparse as sp
from mpi4py import MPI
from numpy.typing import NDArray

from carillon.processes.threads import in_parallel, split
from solver.assembly.node_rows import Halo

Array = NDArray[np.floating]

SIDE = 3
"""Rows and columns of a block; the levels of the multigrid have three or six unknowns a node."""


class BlockRows:
    """This rank's rows of a sparse matrix, square or not, whose sizes are multiples of three."""

    def __init__(self, matrix: Any, comm: MPI.Comm, dtype: Any, threads: int) -> None:
        """Copy the rows of `matrix` (AIJ); collective."""
        start, stop = matrix.getOwnershipRangeColumn()
        indptr, columns, values = matrix.getValuesCSR()
        outside = (columns < start) | (columns >= stop)
        nodes = np.unique(columns[outside] // SIDE)
        ghosts = (SIDE * nodes[:, None] + np.arange(SIDE)).ravel()
        local = np.where(outside, stop - start + np.searchsorted(ghosts, columns), columns - start)
        shape = (len(indptr) - 1, stop - start + len(ghosts))
        rows = sp.csr_matrix((values.astype(dtype), local, indptr), shape=shape)
        blocks = rows.tobsr((SIDE, SIDE))
        self.shape = (shape[0], stop - start)
        self._indptr, self._columns, self._blocks = blocks.indptr, blocks.indices, blocks.data
        starts = np.array([*comm.allgather(start), comm.allreduce(stop - start)])
        self._halo = Halo(nodes, start // SIDE, starts // SIDE, comm)
        self._threads = threads

    def add_product(self, block: Array, result: Array, sign: float = 1.0) -> None:
        """Add `sign` times the product with `block` (local columns, k) to `result`; collective."""
        ghosts = self._halo.exchange(block)
        whole = np.concatenate([block, ghosts]) if len(ghosts) else block

        def rows(start: int, stop: int) -> None:
            _add_product(
                start, stop, self._indptr, self._columns, self._blocks, whole, result, sign
            )

        count = self.shape[0] // SIDE
        in_parallel(rows, split(count, self._threads, max(count, 1)), self._threads)

    def times(self, block: Array) -> Array:
        """Product (local rows, k) with `block` (local columns, k); collective."""
        result = np.zeros((self.shape[0], block.shape[1]), dtype=block.dtype)
        self.add_product(block, result)
        return result

    def diagonal(self) -> Array:
        """Diagonal (local,) of a square matrix."""
        row = np.repeat(np.arange(len(self._indptr) - 1), np.diff(self._indptr))
        own = self._columns == row
        return np.ascontiguousarray(np.einsum("nii->ni", self._blocks[own])).ravel()


@numba.njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
def _add_product(  # type: ignore[no-untyped-def]
    start, stop, indptr, columns, blocks, X, result, sign
):
    width = X.shape[1]
    for row in range(start, stop):
        top, middle, bottom = result[3 * row], result[3 * row + 1], result[3 * row + 2]
        for number in range(indptr[row], indptr[row + 1]):
            first = 3 * columns[number]
            u, v, w = X[first], X[first + 1], X[first + 2]
            B = blocks[number]
            tu, tv, tw = sign * B[0, 0], sign * B[0, 1], sign * B[0, 2]
            mu, mv, mw = sign * B[1, 0], sign * B[1, 1], sign * B[1, 2]
            bu, bv, bw = sign * B[2, 0], sign * B[2, 1], sign * B[2, 2]
            for k in range(width):
                top[k] += tu * u[k] + tv * v[k] + tw * w[k]
                middle[k] += mu * u[k] + mv * v[k] + mw * w[k]
                bottom[k] += bu * u[k] + bv * v[k] + bw * w[k]
