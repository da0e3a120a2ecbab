"""Eigenpairs of a reduced pencil that several ranks share."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.linalg import blas

from solver.distribution.messages import receive_arrays, send_arrays
from solver.hcms.counts import Tally, count_shared_eigenproblem
from solver.hcms.merge import Reduced
from solver.hcms.scalapack import ProcessGrid, places

Array = NDArray[np.float64]

CHECK_TOLERANCE = 1e-8
"""Largest relative error of the eigenvectors' products with K and M."""
_PENCIL, _VECTORS = 21, 22


def shared_pairs(
    comm: MPI.Comm, reduced: Reduced | None, tally: Tally
) -> tuple[Array, Array] | None:
    """All eigenpairs of the pencil that rank 0 of `comm` has, on rank 0; collective.

    They are those of `solver.hcms.merge.all_pairs` but for rounding, and the signs of the vectors.

    Returns
    -------
    tuple[Array, Array] | None
        Values (n,) and vectors (n, n); None on the other ranks.

    Raises
    ------
    numpy.linalg.LinAlgError
        If ScaLAPACK does not converge, on the ranks that it tells, or its vectors are wrong.
    """
    if reduced is None:
        _help(comm, tally)
        return None
    order = len(reduced.stiffness)
    matrices = [matrix for matrix in reduced if matrix is not None]

    def part(rank: int) -> list[Array]:
        """Of either matrix, as rows of the transpose: columns are contiguous there."""
        rows, columns = places(order, rank, comm.size)
        return [np.ascontiguousarray(matrix[np.ix_(rows, columns)].T) for matrix in matrices]

    sent = [
        tally.sent(send_arrays(comm, [np.array([order]), *part(rank)], rank, _PENCIL))
        for rank in range(1, comm.size)
    ]
    K, *M = part(0)
    grid = ProcessGrid(comm, order)
    values, vectors = grid.eigenpairs(K.T, M[0].T if M else None)
    for messages in sent:
        messages.wait()
    count_shared_eigenproblem(tally, order, bool(M), comm.size)
    whole = np.empty((order, order), order="F")
    whole[np.ix_(*places(order, 0, comm.size))] = vectors
    for rank in range(1, comm.size):
        with tally.idle():
            (columns,) = receive_arrays(comm, rank, _VECTORS)
        whole[np.ix_(*places(order, rank, comm.size))] = columns.T
    grid.close()
    _check(reduced, values, whole)
    return values, whole


def _help(comm: MPI.Comm, tally: Tally) -> None:
    with tally.idle():
        order, K, *M = receive_arrays(comm, 0, _PENCIL)
    grid = ProcessGrid(comm, int(order[0]))
    _, vectors = grid.eigenpairs(K.T, M[0].T if M else None)
    count_shared_eigenproblem(tally, int(order[0]), bool(M), comm.size)
    tally.sent(send_arrays(comm, [vectors.T], 0, _VECTORS)).wait()
    grid.close()


def _check(reduced: Reduced, values: Array, vectors: Array) -> None:
    """Raise an error unless Q^T K Q x = D x and Q^T M Q x = x: ScaLAPACK hides some faults."""
    x = np.ones(len(values))
    for matrix, expected in ((reduced.stiffness, values), (reduced.mass, x)):
        product = vectors @ x
        if matrix is not None:
            product = blas.dsymv(1.0, matrix, product, lower=1)
        if np.abs(vectors.T @ product - expected).max() > CHECK_TOLERANCE * np.abs(expected).max():
            raise np.linalg.LinAlgError("ScaLAPACK's eigenvectors do not diagonalise the pencil")
