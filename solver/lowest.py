"""Lowest eigenpairs of a symmetric pencil that fits on one rank."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from mpi4py import MPI
from numpy.typing import NDArray

from carillon.errors import LocalConvergenceError
from solver.eigensolver import distributed_matrix, smallest_eigenpairs

Array = NDArray[np.float64]

DENSE_UNKNOWNS = 600
"""Up to this size all pairs by LAPACK are faster than the lowest by Lanczos."""
DENSE_SHARE = 0.3
"""Above this share of wanted pairs LAPACK is faster too."""
LOCAL_TOLERANCE = 1e-8
"""Residual tolerance of local modes; looser ones would leave the basis less than orthonormal."""
SHIFT_FRACTION = 1e-6
"""Shift as a fraction of the ratio of the diagonals, which is typical of the highest modes."""


def lowest_modes(K: sp.csr_matrix, M: sp.csr_matrix, count: int) -> tuple[Array, Array]:
    """Lowest `count` eigenpairs of K x = lambda M x; K may be singular, M is positive definite.

    Returns
    -------
    values (count,) ascending and M-orthonormal vectors (n, count).

    Raises
    ------
    LocalConvergenceError
        If fewer pairs converge.
    """
    size = K.shape[0]
    if size <= DENSE_UNKNOWNS or count > DENSE_SHARE * size:
        values, vectors = la.eigh(K.toarray(), M.toarray(), driver="gvd", check_finite=False)
        return values[:count], np.asfortranarray(vectors[:, :count])
    stiffness, mass = (distributed_matrix(matrix, MPI.COMM_SELF) for matrix in (K, M))
    shift = SHIFT_FRACTION * K.diagonal().mean() / M.diagonal().mean()
    try:
        values, vectors, _ = smallest_eigenpairs(stiffness, mass, count, shift, LOCAL_TOLERANCE)
    finally:
        stiffness.destroy()
        mass.destroy()
    if len(values) < count:
        raise LocalConvergenceError(
            f"a subdomain of {size} unknowns gave {len(values)} of {count} modes"
        )
    return values, vectors
