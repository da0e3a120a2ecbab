"""SLEPc's Lanczos methods in shift-and-invert mode, set up in one place."""

from contextlib import suppress
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.processes.petsc import PETSc
from carillon.processes.slepc import SLEPc
from solver.assembly.system import System
from solver.linear.factorisation import definite_packages
from solver.linear.petsc_options import OPTIONS_PREFIX, require_known_options

TYPES = {"slepc": SLEPc.EPS.Type.KRYLOVSCHUR, "arpack": SLEPc.EPS.Type.ARPACK}
MAX_ITERATIONS = 500
ARPACK_MARGIN = 2
"""Number of unknowns that ARPACK needs beyond the requested pairs."""
SUBSPACE, FEWEST_MORE = 1.25, 24
"""Vectors that Krylov-Schur keeps for each pair wanted, and least number beyond these.  To make the
two a pair that SLEPc would keep orthogonal takes longer than the solves that they save."""


def smallest_eigenpairs(
    system: System,
    known: Array,
    count: int,
    shift: float,
    start: Array,
    tolerance: float,
    method: str = "slepc",
    configurable: bool = True,
) -> tuple[Array, Array, int]:
    """See `solver.reference.eigensolver.smallest_eigenpairs`.

    Krylov-Schur deflates the known vectors.  ARPACK cannot, since SLEPc lets it keep its basis
    where the deflated vectors are: it finds as many pairs more, of which those in the span of the
    known ones are dropped. SLEPc has the method, which the caller has asked for.

    Parameters
    ----------
    configurable
        Whether PETSc's options database may overrule this set-up.
    """
    *others, last = definite_packages(system.comm.size)

    def search(package: str) -> tuple[Array, Array, int]:
        solver = SLEPc.EPS().create(system.comm)
        vectors = [_petsc_vector(start, system.comm)]
        try:
            solver.setType(TYPES[method])
            solver.setOperators(system.K, system.M)
            solver.setProblemType(SLEPc.EPS.ProblemType.GHEP)
            solver.setTolerances(tolerance, MAX_ITERATIONS)
            solver.setInitialSpace(vectors[0])
            asked = count
            if method == "arpack":
                asked = min(count + known.shape[1], system.n_dofs - ARPACK_MARGIN)
                solver.setDimensions(asked)
            else:
                vectors += [_petsc_vector(column, system.comm) for column in known.T]
                solver.setDeflationSpace(vectors[1:])
                subspace = max(round(SUBSPACE * asked), asked + FEWEST_MORE)
                solver.setDimensions(asked, min(subspace, system.n_dofs))
            solver.setTarget(-shift)
            solver.setWhichEigenpairs(SLEPc.EPS.Which.TARGET_MAGNITUDE)
            transform = solver.getST()
            transform.setType(SLEPc.ST.Type.SINVERT)
            transform.setMatStructure(PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
            linear = transform.getKSP()
            linear.setType(PETSc.KSP.Type.PREONLY)
            preconditioner = linear.getPC()
            preconditioner.setType(PETSc.PC.Type.CHOLESKY)
            preconditioner.setFactorSolverType(package)
            if configurable:
                solver.setOptionsPrefix(OPTIONS_PREFIX)
                solver.setFromOptions()
                solver.setUp()
                require_known_options()
            solver.solve()
            values, modes = _collect(system, solver, min(solver.getConverged(), asked))
            return values, modes, int(solver.getIterationNumber())
        finally:
            for used in (solver, *vectors):
                used.destroy()

    for package in others:
        with suppress(PETSc.Error):
            return search(package)
    return search(last)


def _petsc_vector(entries: Array, comm: Any) -> Any:
    return PETSc.Vec().createWithArray(np.array(entries), comm=comm)


def _collect(system: System, solver: SLEPc.EPS, count: int) -> tuple[Array, Array]:
    """The first `count` eigenpairs, values ascending, vectors row-major."""
    values = np.array([solver.getEigenvalue(index).real for index in range(count)])
    # Two processors may round apart, but have to agree on the order of a multiple eigenvalue.
    values = system.comm.bcast(values)
    order = np.argsort(values, kind="stable")
    vector = system.K.createVecRight()
    vectors = np.empty((vector.getLocalSize(), count))
    for column, index in enumerate(order):
        solver.getEigenpair(int(index), vector)
        vectors[:, column] = vector.getArray(readonly=True)
    vector.destroy()
    return values[order], vectors
