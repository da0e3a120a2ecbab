"""SLEPc's Lanczos methods in shift-and-invert mode, set up in one place."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from petsc4py import PETSc
from slepc4py import SLEPc

from carillon.errors import UserError

Array = NDArray[np.float64]

TYPES = {"slepc": SLEPc.EPS.Type.KRYLOVSCHUR, "arpack": SLEPc.EPS.Type.ARPACK}
MAX_ITERATIONS = 500
OPTIONS_PREFIX = "carillon_"
"""What the names of PETSc's options for this program begin with."""


def insert_options(text: str | None) -> None:
    """Put options like `-carillon_eps_ncv 400` into PETSc's options database.

    Raises
    ------
    UserError
        If an option lacks the prefix, and would be ignored.
    """
    if text is None:
        return
    words = text.split()
    strangers = [
        word
        for word in words
        if word[:1] == "-" and word[1:2].isalpha() and not word.startswith(f"-{OPTIONS_PREFIX}")
    ]
    if strangers or not words or words[0][0] != "-":
        found = strangers[0] if strangers else text
        raise UserError(f"PETSc option {found!r}: expected names like -{OPTIONS_PREFIX}eps_ncv")
    PETSc.Options().insertString(text)


def factor_package(ranks: int) -> str:
    """PETSc's name of the sparse Cholesky to use: MUMPS, or PETSc's own on one rank without it.

    Raises
    ------
    UserError
        On several ranks without MUMPS.
    """
    if PETSc.Sys.hasExternalPackage("mumps"):
        return "mumps"
    if ranks == 1:
        return "petsc"
    raise UserError(
        "this PETSc was built without MUMPS, which a parallel factorisation needs; run on one rank "
        "or rebuild PETSc with MUMPS"
    )


def distributed_matrix(rows: sp.csr_matrix, comm: Any) -> Any:
    """Symmetric PETSc matrix from this rank's rows (local, n), in blocks of three unknowns."""
    local, total = rows.shape
    csr = (
        rows.indptr.astype(PETSc.IntType),
        rows.indices.astype(PETSc.IntType),
        rows.data.astype(PETSc.ScalarType),
    )
    matrix = PETSc.Mat().createAIJ(((local, total), (local, total)), bsize=3, csr=csr, comm=comm)
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    return matrix


def smallest_eigenpairs(
    K: Any, M: Any, count: int, shift: float, tolerance: float, method: str = "slepc"
) -> tuple[Array, Array, int]:
    """Eigenpairs of K x = lambda M x with lambda closest to -`shift`, below the whole spectrum.

    Parameters
    ----------
    K, M
        PETSc matrices; K positive semidefinite, M positive definite.
    count
        Number of pairs wanted.
    shift
        Positive; K + shift M is factorised.
    tolerance
        Relative residual.
    method
        `slepc` (Krylov-Schur) or `arpack`.

    Returns
    -------
    values (found,) ascending, M-orthonormal vectors (local, found), outer iterations; `found` may
    be smaller than `count`, which is for the caller to judge.
    """
    solver = SLEPc.EPS().create(K.getComm())
    try:
        try:
            solver.setType(TYPES[method])
        except PETSc.Error:
            raise UserError(
                f"this SLEPc was built without {method}; use slepc or rebuild SLEPc with it"
            ) from None
        solver.setOperators(K, M)
        solver.setProblemType(SLEPc.EPS.ProblemType.GHEP)
        solver.setDimensions(count)
        solver.setTolerances(tolerance, MAX_ITERATIONS)
        solver.setTarget(-shift)
        solver.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
        transform = solver.getST()
        transform.setType(SLEPc.ST.Type.SINVERT)
        transform.setMatStructure(PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        linear = transform.getKSP()
        linear.setType(PETSc.KSP.Type.PREONLY)
        preconditioner = linear.getPC()
        preconditioner.setType(PETSc.PC.Type.CHOLESKY)
        preconditioner.setFactorSolverType(factor_package(K.getComm().size))
        # Everything above may be overruled by PETSc's options database.
        solver.setOptionsPrefix(OPTIONS_PREFIX)
        solver.setFromOptions()
        solver.solve()
        values, vectors = _collect(K, solver, min(solver.getConverged(), count))
        return values, vectors, int(solver.getIterationNumber())
    finally:
        solver.destroy()


def _collect(K: Any, solver: SLEPc.EPS, count: int) -> tuple[Array, Array]:
    vector = K.createVecRight()
    values = np.empty(count)
    vectors = np.empty((vector.getLocalSize(), count), order="F")
    for index in range(count):
        values[index] = solver.getEigenpair(index, vector).real
        vectors[:, index] = vector.getArray(readonly=True)
    vector.destroy()
    order = np.argsort(values)
    return values[order], np.asfortranarray(vectors[:, order])
