"""Lowest eigenpairs of a symmetric pencil that fits on one rank."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import slepc4py
from numpy.typing import NDArray

slepc4py.init([])
from petsc4py import PETSc  # noqa: E402
from slepc4py import SLEPc  # noqa: E402

from carillon.errors import LocalConvergenceError  # noqa: E402

Array = NDArray[np.float64]

DENSE_UNKNOWNS = 600
"""Up to this size all pairs by LAPACK are faster than the lowest by Lanczos."""
DENSE_SHARE = 0.3
"""Above this share of wanted pairs LAPACK is faster too."""
LOCAL_TOLERANCE = 1e-5
"""Residual tolerance of local modes; the truncation of the basis is a far larger error."""


def lowest_modes(K: sp.csr_matrix, M: sp.csr_matrix, count: int) -> tuple[Array, Array]:
    """Lowest `count` eigenpairs of K x = lambda M x; K may be singular, M is positive definite.

    Returns
    -------
    values (count,) ascending and M-orthonormal vectors (n, count).
    """
    size = K.shape[0]
    if size <= DENSE_UNKNOWNS or count > DENSE_SHARE * size:
        values, vectors = la.eigh(K.toarray(), M.toarray(), driver="gvd", check_finite=False)
        return values[:count], np.asfortranarray(vectors[:, :count])
    return _krylov_schur(K, M, count)


def _krylov_schur(K: sp.csr_matrix, M: sp.csr_matrix, count: int) -> tuple[Array, Array]:
    stiffness, mass = _petsc(K), _petsc(M)
    # Below all eigenvalues, and small against the elastic ones: the diagonal's ratio is a typical
    # eigenvalue of the highest modes.
    shift = 1e-6 * K.diagonal().mean() / M.diagonal().mean()
    solver = SLEPc.EPS().create(PETSc.COMM_SELF)
    try:
        solver.setOperators(stiffness, mass)
        solver.setProblemType(SLEPc.EPS.ProblemType.GHEP)
        solver.setDimensions(count)
        solver.setTolerances(LOCAL_TOLERANCE, 500)
        solver.setTarget(-shift)
        solver.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
        transform = solver.getST()
        transform.setType(SLEPc.ST.Type.SINVERT)
        linear = transform.getKSP()
        linear.setType(PETSc.KSP.Type.PREONLY)
        preconditioner = linear.getPC()
        preconditioner.setType(PETSc.PC.Type.CHOLESKY)
        if PETSc.Sys.hasExternalPackage("mumps"):
            preconditioner.setFactorSolverType("mumps")
        solver.solve()
        if solver.getConverged() < count:
            raise LocalConvergenceError(
                f"a subdomain of {K.shape[0]} unknowns gave {solver.getConverged()} of {count} modes"
            )
        vector = stiffness.createVecRight()
        values = np.empty(count)
        vectors = np.empty((K.shape[0], count), order="F")
        for index in range(count):
            values[index] = solver.getEigenpair(index, vector).real
            vectors[:, index] = vector.getArray(readonly=True)
        vector.destroy()
    finally:
        solver.destroy()
        stiffness.destroy()
        mass.destroy()
    order = np.argsort(values)
    return values[order], np.asfortranarray(vectors[:, order])


def _petsc(matrix: sp.csr_matrix):  # type: ignore[no-untyped-def]
    csr = (
        matrix.indptr.astype(PETSc.IntType),
        matrix.indices.astype(PETSc.IntType),
        matrix.data.astype(PETSc.ScalarType),
    )
    return PETSc.Mat().createAIJ(matrix.shape, csr=csr, comm=PETSc.COMM_SELF)
