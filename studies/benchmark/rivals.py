"""The general eigensolvers that the method is timed against, set up as well as they can be."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.errors import ConvergenceError
from carillon.fem.model import RIGID_MODES, ElasticModel
from carillon.processes.mpi import MPI
from carillon.processes.petsc import PETSc
from carillon.processes.slepc import SLEPc
from solver.assembly.system import System, assemble
from solver.distribution.local_mesh import distribute
from solver.linear.factorisation import definite_packages
from solver.linear.petsc_options import OPTIONS_PREFIX
from solver.reference.slepc_lanczos import FEWEST_MORE, SUBSPACE
from solver.subspace.rayleigh_ritz import rigid_pairs

PACKAGES = {"cholmod": "suitesparse", "mumps": "mumps"}
"""Sparse Cholesky factorisations that are tried, and the packages that PETSc has them from."""
SUBSPACES = (1.25, 1.5, 2.0)
"""Lanczos vectors for each mode wanted that are tried."""
MOST_RESTARTS = 2000
"""Restarts that ARPACK may make without a factorisation."""


@dataclass(frozen=True)
class SlepcConfiguration:
    """How SLEPc's shift-and-invert Krylov-Schur is set up."""

    package: str
    """Sparse Cholesky factorisation, as PETSc calls it."""
    subspace: float
    """Lanczos vectors for each mode wanted."""

    @classmethod
    def default(cls, ranks: int) -> SlepcConfiguration:
        """What `solver modes --method slepc` does."""
        return cls(definite_packages(ranks)[0], SUBSPACE)

    def __str__(self) -> str:
        return f"{self.package}, {self.subspace:g} vectors a mode"

    @contextmanager
    def in_force(self, modes: int) -> Iterator[None]:
        """Every SLEPc solver made in the body is set up so, by PETSc's options database."""
        chosen = {
            "eps_ncv": max(round(self.subspace * modes), modes + FEWEST_MORE),
            "st_pc_factor_mat_solver_type": self.package,
        }
        with petsc_options(chosen), without_purification():
            yield


def without_purification() -> AbstractContextManager[None]:
    """SLEPc applies the operator to every eigenvector once more, which a regular mass can spare."""
    return petsc_options({"eps_purify": 0})


@contextmanager
def petsc_options(chosen: Mapping[str, Any]) -> Iterator[None]:
    """PETSc options of the eigensolver, without its prefix, that hold within the body."""
    options = PETSc.Options()
    for name, value in chosen.items():
        options[f"{OPTIONS_PREFIX}{name}"] = value
    try:
        yield
    finally:
        for name in chosen:
            options.delValue(f"{OPTIONS_PREFIX}{name}")


def configurations(ranks: int) -> list[SlepcConfiguration]:
    """Every configuration that is tried in tuning; CHOLMOD runs on one rank alone."""
    present = [
        package
        for package, bundle in PACKAGES.items()
        if PETSc.Sys.hasExternalPackage(bundle) and (ranks == 1 or package == "mumps")
    ]
    return [SlepcConfiguration(*chosen) for chosen in product(present, SUBSPACES)]


def smallest_without_factor(
    model: ElasticModel | None, modes: int, tolerance: float, seed: int, comm: MPI.Comm
) -> Array:
    """Lowest eigenvalues (modes,) [rad^2/s^2] by ARPACK in regular mode: products alone.

    With a diagonal mass the problem is D x' = lambda x', D = M^-1/2 K M^-1/2.  The rigid motions
    are given: their zeros would never pass ARPACK's test, which is relative to the eigenvalue.
    Copies of other multiple eigenvalues may be missed.

    Raises ConvergenceError if too few pairs converge.
    """
    system = assemble(distribute(model, None, seed, comm), comm)
    rigid_values, rigid = rigid_pairs(system)
    operator = _elastic_operator(system, rigid)
    solver = SLEPc.EPS().create(comm)
    solver.setType(SLEPc.EPS.Type.ARPACK)
    solver.setOperators(operator)
    solver.setProblemType(SLEPc.EPS.ProblemType.HEP)
    solver.setWhichEigenpairs(SLEPc.EPS.Which.SMALLEST_REAL)
    solver.setDimensions(modes - RIGID_MODES)
    solver.setTolerances(tolerance, MOST_RESTARTS)
    solver.solve()
    converged = solver.getConverged()
    elastic = np.sort([solver.getEigenvalue(index).real for index in range(converged)])
    for used in (solver, operator, system):
        used.destroy()
    if RIGID_MODES + converged < modes:
        raise ConvergenceError(
            f"ARPACK in regular mode converged {RIGID_MODES + converged} of {modes} modes in "
            f"{MOST_RESTARTS} restarts"
        )
    return np.concatenate([rigid_values, elastic])[:modes]


def _elastic_operator(system: System, rigid: Array) -> PETSc.Mat:
    """M^-1/2 K M^-1/2 plus a matrix of rank six that moves the rigid motions' zeros to the top."""
    scale = system.M.getDiagonal()
    scale.sqrtabs()
    motions = np.asfortranarray(rigid * scale.getArray(readonly=True)[:, None])
    size = ((len(motions), system.n_dofs), (None, RIGID_MODES))
    columns = PETSc.Mat().createDense(size, array=motions, comm=system.comm)
    columns.assemble()
    scale.reciprocal()
    scaled = system.K.copy()
    scaled.diagonalScale(scale, scale)
    top = PETSc.Vec().createSeq(RIGID_MODES)
    top.set(scaled.norm(PETSc.NormType.NORM_INFINITY))
    operator = PETSc.Mat().createLRC(scaled, columns, top, columns)
    operator.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    # The operator holds on to its parts.
    for part in (scale, scaled, columns, top):
        part.destroy()
    return operator
