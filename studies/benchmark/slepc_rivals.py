"""SLEPc's eigensolvers beside Krylov-Schur in shift-and-invert mode."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import scipy.sparse.linalg as sla
from mpi4py import MPI

from carillon.errors import ConvergenceError
from carillon.processes.petsc import PETSc
from carillon.processes.slepc import SLEPc
from solver.assembly.petsc_matrix import distributed_matrix
from solver.linear.factorisation import definite_packages
from studies.benchmark.search import Array, Pairs, RivalSearch, TimeLimit, ascending

STANDARD = (SLEPc.EPS.Type.KRYLOVSCHUR, SLEPc.EPS.Type.EVSL)
"""Types that are used for a mass that is one, as that of the scaled lumped mass is."""
BLOCK = 64
"""Vectors that LOBPCG works on together, at most."""
INNER_STEPS = 10
"""Steps that Jacobi-Davidson's correction equation is solved by."""
DEGREE = 1.5
"""Degree of the filter, a polynomial of the stiffness, over the square root of the ratio of the
spectrum's bound to the interval's end."""
HALF = 0.5
"""A vector with more than this share of its mass in rigid motions is one of them."""
ITERATIONS = 100_000
"""Iterations allowed, of which the time limit leaves fewer."""
MOMENTS = 8
"""Moments of the contour integrals."""


def lobpcg(search: RivalSearch) -> Pairs:
    """LOBPCG, preconditioned by a Cholesky factorisation of K + sigma M.

    Its basis of three blocks is not kept independent: SLEPc 3.18 ends with an error of LAPACK for
    blocks of a dozen vectors and more, whatever the preconditioner, and crawls with smaller ones.
    """

    def prepare(solver: SLEPc.EPS) -> None:
        solver.setLOBPCGBlockSize(min(BLOCK, search.count))

    return _preconditioned(search, SLEPc.EPS.Type.LOBPCG, prepare)


def davidson(search: RivalSearch) -> Pairs:
    """Generalised Davidson, preconditioned likewise; blocks of vectors make it slower."""
    return _preconditioned(search, SLEPc.EPS.Type.GD, lambda _: None)


def jacobi_davidson(search: RivalSearch) -> Pairs:
    """Jacobi-Davidson, whose correction equation is preconditioned likewise."""

    def prepare(solver: SLEPc.EPS) -> None:
        inner = solver.getST().getKSP()
        inner.setType(PETSc.KSP.Type.BCGSL)
        inner.setTolerances(max_it=INNER_STEPS)

    return _preconditioned(search, SLEPc.EPS.Type.JD, prepare)


def contour_integrals(search: RivalSearch) -> Pairs:
    """Sakurai-Sugiura contour integrals over the interval that holds the eigenvalues."""

    def prepare(solver: SLEPc.EPS) -> None:
        region = solver.getRG()
        region.setType(SLEPc.RG.Type.INTERVAL)
        region.setIntervalEndpoints(*search.interval, 0.0, 0.0)
        solver.setWhichEigenpairs(SLEPc.EPS.Which.ALL)
        block = -(-2 * search.count // MOMENTS)
        solver.setCISSSizes(bs=block, ms=MOMENTS, bsmax=2 * block)

    return _solve(search, SLEPc.EPS.Type.CISS, prepare)


def filtered(search: RivalSearch) -> Pairs:
    """Krylov-Schur with a polynomial filter for all eigenvalues up to the last one wanted.

    The rigid motions are among them: a filter with one edge needs a lower degree than with two.
    """
    high = search.interval[1]
    bound = sla.norm(search.K, np.inf)

    def prepare(solver: SLEPc.EPS) -> None:
        transform = solver.getST()
        transform.setType(SLEPc.ST.Type.FILTER)
        transform.setFilterRange(-high, bound)
        transform.setFilterDegree(round(DEGREE * np.sqrt(bound / high)))
        solver.setWhichEigenpairs(SLEPc.EPS.Which.ALL)
        solver.setInterval(-high, high)

    values, vectors = _solve(search, SLEPc.EPS.Type.KRYLOVSCHUR, prepare)
    # Copies of the sixfold zero may be missing, so that they are known by their vectors alone.
    elastic = np.square(search.rigid.T @ vectors).sum(axis=0) < HALF
    return values[elastic], vectors[:, elastic]


def evsl(search: RivalSearch) -> Pairs:
    """EVSL's filtered Lanczos method for the interval of the elastic eigenvalues."""

    def prepare(solver: SLEPc.EPS) -> None:
        solver.setWhichEigenpairs(SLEPc.EPS.Which.ALL)
        solver.setInterval(*search.interval)

    return _solve(search, SLEPc.EPS.Type.EVSL, prepare)


def _preconditioned(search: RivalSearch, kind: str, prepare: Callable[[SLEPc.EPS], None]) -> Pairs:
    def prepare_all(solver: SLEPc.EPS) -> None:
        shifted = distributed_matrix(search.shifted, MPI.COMM_SELF)
        shifted.setOption(PETSc.Mat.Option.SPD, True)
        rigid = [PETSc.Vec().createWithArray(column.copy()) for column in search.rigid.T]
        solver.setDeflationSpace(rigid)
        solver.setDimensions(search.count)
        solver.setWhichEigenpairs(SLEPc.EPS.Which.SMALLEST_REAL)
        transform = solver.getST()
        transform.setType(SLEPc.ST.Type.PRECOND)
        transform.setPreconditionerMat(shifted)
        inner = transform.getKSP()
        inner.setType(PETSc.KSP.Type.PREONLY)
        inner.getPC().setType(PETSc.PC.Type.CHOLESKY)
        inner.getPC().setFactorSolverType(definite_packages(1)[0])
        prepare(solver)

    return _solve(search, kind, prepare_all)


def _solve(search: RivalSearch, kind: str, prepare: Callable[[SLEPc.EPS], None]) -> Pairs:
    generalised = kind not in STANDARD
    K, M = (distributed_matrix(matrix, MPI.COMM_SELF) for matrix in (search.K, search.M))
    problem = SLEPc.EPS.ProblemType
    solver = SLEPc.EPS().create(MPI.COMM_SELF)
    try:
        solver.setType(kind)
        solver.setOperators(K, M if generalised else None)
        solver.setProblemType(problem.GHEP if generalised else problem.HEP)
        solver.setTolerances(search.tolerance, ITERATIONS)
        if kind != SLEPc.EPS.Type.CISS:  # which knows no test of its own
            solver.setStoppingTest(partial(_stop, search.limit))
        prepare(solver)
        solver.solve()
        found = solver.getConverged()
        if found < search.count:
            search.limit.check()
            raise ConvergenceError(
                f"SLEPc converged {found} of {search.count} elastic modes in "
                f"{solver.getIterationNumber()} iterations"
            )
        values = [solver.getEigenvalue(index).real for index in range(found)]
        return ascending(values, _vectors(solver, K, found))
    except PETSc.Error as error:
        said = str(error).strip().splitlines()[-1].split("] ", 1)[-1]
        raise ConvergenceError(f"SLEPc: {said}") from None
    finally:
        for used in (solver, K, M):
            used.destroy()


def _stop(
    limit: TimeLimit, _: SLEPc.EPS, iterations: int, most: int, converged: int, wanted: int
) -> int:
    reason = SLEPc.EPS.ConvergedReason
    if converged >= wanted:
        return int(reason.CONVERGED_TOL)
    return int(reason.DIVERGED_ITS if iterations >= most or limit.over else reason.ITERATING)


def _vectors(solver: SLEPc.EPS, K: PETSc.Mat, found: int) -> Array:
    vector = K.createVecRight()
    vectors = np.empty((vector.getLocalSize(), found))
    for index in range(found):
        solver.getEigenpair(index, vector)
        vectors[:, index] = vector.getArray(readonly=True)
    vector.destroy()
    return vectors
