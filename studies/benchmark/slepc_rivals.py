"""SLEPc's eigensolvers beside Krylov-Schur in shift-and-invert mode, by options of its database.

The basis of LOBPCG's three blocks is not kept independent: SLEPc 3.18 ends with an error of LAPACK
for blocks of a dozen vectors and more, whatever the preconditioner, and crawls with smaller ones.
Blocks make generalised Davidson slower.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
import scipy.sparse.linalg as sla

from carillon.errors import ConvergenceError
from carillon.processes.mpi import MPI
from carillon.processes.petsc import PETSc
from carillon.processes.slepc import SLEPc
from solver.assembly.system import distributed_matrix
from solver.linear.factorisation import definite_packages
from solver.linear.petsc_options import OPTIONS_PREFIX
from studies.benchmark.rivals import petsc_options
from studies.benchmark.search import Array, Pairs, RivalSearch, ascending

TYPE = SLEPc.EPS.Type
STANDARD = (TYPE.KRYLOVSCHUR, TYPE.EVSL)
"""Types that are used for a mass that is one, as that of the scaled lumped mass is."""
BLOCK = 64
"""Vectors that LOBPCG works on together, at most."""
DEGREE = 1.5
"""Degree of the filter, a polynomial of the stiffness, over the square root of the ratio of the
spectrum's bound to the interval's end."""
HALF = 0.5
"""A vector with more than this share of its mass in rigid motions is one of them."""
ITERATIONS = 100_000
"""Iterations allowed, of which the time limit leaves fewer."""
MOMENTS = 8
"""Moments of the contour integrals (Sakurai-Sugiura)."""
CHOLESKY = {
    "st_type": "precond",
    "st_ksp_type": "preonly",
    "st_pc_type": "cholesky",
    "st_pc_factor_mat_solver_type": definite_packages(1)[0],
}
"""Preconditioner: a Cholesky factorisation of K + sigma M."""

Options = Mapping[str, Any]


def _contour(search: RivalSearch) -> Options:
    block = -(-2 * search.count // MOMENTS)
    return {
        "eps_all": None,
        "eps_ciss_blocksize": block,
        "eps_ciss_moments": MOMENTS,
        "eps_ciss_maxblocksize": 2 * block,
        "rg_type": "interval",
        "rg_interval_endpoints": _ends(*search.interval, 0.0, 0.0),
    }


def _filter(search: RivalSearch) -> Options:
    """For all eigenvalues up to the last one wanted: a filter with one edge needs a lower degree.

    The rigid motions are among them.
    """
    high, bound = search.interval[1], float(sla.norm(search.K, np.inf))
    return {
        "st_type": "filter",
        "st_filter_range": _ends(-high, bound),
        "st_filter_degree": round(DEGREE * np.sqrt(bound / high)),
        "eps_interval": _ends(-high, high),
    }


OPTIONS: dict[str, Callable[[RivalSearch], Options]] = {
    TYPE.LOBPCG: lambda search: CHOLESKY | {"eps_lobpcg_blocksize": min(BLOCK, search.count)},
    TYPE.GD: lambda _: CHOLESKY,
    # The steps that the correction equation is solved by.
    TYPE.JD: lambda _: CHOLESKY | {"st_ksp_type": "bcgsl", "st_ksp_max_it": 10},
    TYPE.CISS: _contour,
    TYPE.KRYLOVSCHUR: _filter,
    TYPE.EVSL: lambda search: {"eps_interval": _ends(*search.interval)},
}
"""Options of the database by type, without SLEPc's prefix."""


def _ends(*numbers: float) -> str:
    return ",".join(repr(float(number)) for number in numbers)


def solve(kind: str, search: RivalSearch) -> Pairs:
    """Elastic pairs by an eigensolver of `OPTIONS`.

    Raises ConvergenceError if SLEPc was built without it, fails or takes too long.
    """
    options = OPTIONS[kind](search)
    generalised = kind not in STANDARD
    matrices = [distributed_matrix(matrix, MPI.COMM_SELF) for matrix in (search.K, search.M)]
    problem = SLEPc.EPS.ProblemType
    solver = SLEPc.EPS().create(MPI.COMM_SELF)
    try:
        solver.setOptionsPrefix(OPTIONS_PREFIX)
        solver.setType(kind)
        solver.setOperators(matrices[0], matrices[1] if generalised else None)
        solver.setProblemType(problem.GHEP if generalised else problem.HEP)
        solver.setTolerances(search.tolerance, ITERATIONS)
        if kind != TYPE.CISS:  # which knows no test of its own
            solver.setStoppingTest(partial(_stop, search))
        if options.get("st_type") == "precond":
            _deflate(search, solver)
        with petsc_options(options):
            solver.setFromOptions()
            solver.solve()
        converged = solver.getConverged()
        if converged < search.count:
            search.check_time()
            raise ConvergenceError(
                f"SLEPc converged {converged} of {search.count} elastic modes in "
                f"{solver.getIterationNumber()} iterations"
            )
        computed = [solver.getEigenvalue(index).real for index in range(converged)]
        values, vectors = ascending(computed, _vectors(solver, matrices[0], converged))
        if kind != TYPE.KRYLOVSCHUR:
            return values, vectors
        # Copies of the sixfold zero may be missing, so that they are known by their vectors alone.
        elastic = np.square(search.rigid.T @ vectors).sum(axis=0) < HALF
        return values[elastic], vectors[:, elastic]
    except PETSc.Error as error:
        said = str(error).strip().splitlines()[-1].split("] ", 1)[-1]
        raise ConvergenceError(f"SLEPc: {said}") from None
    finally:
        for used in (solver, *matrices):
            used.destroy()


def _deflate(search: RivalSearch, solver: SLEPc.EPS) -> None:
    """Give the rigid motions to a solver for the lowest pairs, and K + sigma M to precondition."""
    shifted = distributed_matrix(search.shifted, MPI.COMM_SELF)
    shifted.setOption(PETSc.Mat.Option.SPD, True)
    solver.setDeflationSpace(
        [PETSc.Vec().createWithArray(column.copy()) for column in search.rigid.T]
    )
    solver.setDimensions(search.count)
    solver.setWhichEigenpairs(SLEPc.EPS.Which.SMALLEST_REAL)
    transform = solver.getST()
    transform.setType(SLEPc.ST.Type.PRECOND)
    transform.setPreconditionerMat(shifted)


def _stop(
    search: RivalSearch, _: SLEPc.EPS, iterations: int, most: int, converged: int, wanted: int
) -> int:
    reason = SLEPc.EPS.ConvergedReason
    if converged >= wanted:
        return int(reason.CONVERGED_TOL)
    return int(reason.DIVERGED_ITS if iterations >= most or search.late else reason.ITERATING)


def _vectors(solver: SLEPc.EPS, K: PETSc.Mat, found: int) -> Array:
    vector = K.createVecRight()
    vectors = np.empty((vector.getLocalSize(), found))
    for index in range(found):
        solver.getEigenpair(index, vector)
        vectors[:, index] = vector.getArray(readonly=True)
    vector.destroy()
    return vectors
