"""Sparse direct solvers of K - shift M, each set up as well as it can be; on one rank."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
import scipy.sparse as sp

from carillon.arrays import Array
from carillon.errors import ConvergenceError
from carillon.processes.petsc import PETSc
from solver.assembly.system import Layout, System
from solver.linear.factorisation import COLUMNS, ROOM, solve_dense
from solver.linear.rank_tree import RankTree
from studies.benchmark.direct_solver import DirectSolver
from studies.benchmark.further_rivals import UnavailableError, require_packages
from studies.benchmark.pardiso import Pardiso
from studies.benchmark.python_rivals import symmetric_superlu
from studies.benchmark.rivals import PACKAGES

_MUMPS_ROOM, _MUMPS_BLOCKING = 14, 27
"""MUMPS's ICNTL of the room beyond its guess [%], and of the columns of a solve."""
_MUMPS_OPERATIONS, _MUMPS_ENTRIES = 3, 29
"""RINFOG of operations of the elimination, and INFOG of the factor's entries: millions if it is
negative."""


@dataclass(frozen=True)
class ShiftedSystem:
    """K - shift M of a system on one rank."""

    layout: Layout
    system: System
    shift: float
    """[rad^2/s^2]; K - shift M is definite if it is negative."""

    @property
    def definite(self) -> bool:
        """Whether the matrix is positive definite."""
        return self.shift < 0.0

    @property
    def threads(self) -> int:
        """Threads that factorise and solve."""
        return self.system.rows.threads

    @cached_property
    def matrix(self) -> sp.csr_matrix:
        """(n, n) K - shift M [N/m], both triangles."""
        return self.system.rows.shifted_csr(self.shift, self.system.n_dofs)


class Multifrontal(DirectSolver):
    """Carillon's own, whose operations are those of a Cholesky factorisation by its fronts."""

    order = "C"

    def __init__(self, shifted: ShiftedSystem) -> None:
        self._shifted = shifted

    def analyse(self) -> None:
        """Dissect the lattice, and share the fronts among the threads."""
        self._tree = RankTree(self._shifted.layout)
        plan = self._tree.plan
        plan.shares(self._shifted.threads)
        self.entries = int(plan.pivot_offset[-1] + plan.coupling_offset[-1])

    def factorise(self) -> None:
        """See `DirectSolver.factorise`."""
        self._factor: Any = None  # whose memory the next one takes over
        self._factor = self._tree.inverse(self._shifted.system, self._shifted.shift)

    def solve(self, block: Array) -> Array:
        """See `DirectSolver.solve`."""
        return np.asarray(self._factor.solve(block))

    @property
    def operations(self) -> float:
        """See `DirectSolver.operations`."""
        return self._tree.plan.operations


class PetscCholesky(DirectSolver):
    """CHOLMOD or MUMPS through PETSc, which tells no operations of CHOLMOD."""

    first_factorises = True

    def __init__(self, shifted: ShiftedSystem, package: str) -> None:
        if not PETSc.Sys.hasExternalPackage(PACKAGES[package]):
            raise UnavailableError(f"this PETSc was built without {PACKAGES[package]}")
        if package == "cholmod" and not shifted.definite:
            raise UnavailableError("needs a shift below all eigenvalues (--definite)")
        system = shifted.system
        self._package, self._comm = package, system.comm
        self._matrix = system.K.copy()
        self._matrix.axpy(
            -shifted.shift, system.M, structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN
        )
        option = PETSc.Mat.Option.SPD if shifted.definite else PETSc.Mat.Option.SYMMETRIC
        self._matrix.setOption(option, True)
        self._pc = PETSc.PC().create(system.comm)

    def analyse(self) -> None:
        """Set up the factorisation for the first time, which factorises, too."""
        self._pc.setOperators(self._matrix)
        self._pc.setType(PETSc.PC.Type.CHOLESKY)
        self._pc.setFactorSolverType(self._package)
        self._pc.setFactorSetUpSolverType()
        self._factor = self._pc.getFactorMatrix()
        if self._package == "mumps":
            self._factor.setMumpsIcntl(_MUMPS_ROOM, ROOM[0])
            self._factor.setMumpsIcntl(_MUMPS_BLOCKING, COLUMNS)
        self._set_up()

    def factorise(self) -> None:
        """Set up again for other values, which leaves out the analysis."""
        self._matrix.stateIncrease()
        self._pc.setOperators(self._matrix)
        self._set_up()

    def _set_up(self) -> None:
        self._pc.setUp()
        if self._package != "mumps":
            self.entries = int(self._factor.getInfo()["nz_used"])
            return
        # PETSc tells nobody before it solves.
        if (status := self._factor.getMumpsInfog(1)) < 0:
            raise ConvergenceError(f"MUMPS: INFOG(1) = {status}")
        entries = self._factor.getMumpsInfog(_MUMPS_ENTRIES)
        self.entries = entries if entries >= 0 else -1_000_000 * entries

    def solve(self, block: Array) -> Array:
        """See `DirectSolver.solve`."""
        return solve_dense(self._factor, block, len(block), self._comm)

    @property
    def operations(self) -> float | None:
        """See `DirectSolver.operations`."""
        mumps = self._package == "mumps"
        return float(self._factor.getMumpsRinfog(_MUMPS_OPERATIONS)) if mumps else None

    def destroy(self) -> None:
        """Free the factorisation and its matrix."""
        self._pc.destroy()
        self._matrix.destroy()


class SuperLU(DirectSolver):
    """SciPy's SuperLU, which analyses and factorises in one step, on one thread."""

    def __init__(self, shifted: ShiftedSystem) -> None:
        self._matrix = shifted.matrix.tocsc()

    def factorise(self) -> None:
        """Factorise, told that the matrix is symmetric."""
        self._factor: Any = None
        self._factor = symmetric_superlu(self._matrix)
        self.entries = int(self._factor.nnz)

    def solve(self, block: Array) -> Array:
        """See `DirectSolver.solve`."""
        return np.asarray(self._factor.solve(block))


def _pardiso(shifted: ShiftedSystem) -> Pardiso:
    require_packages("pypardiso")
    return Pardiso(shifted.matrix, shifted.definite, shifted.threads)


SOLVERS: dict[str, Callable[[ShiftedSystem], DirectSolver]] = {
    "own": Multifrontal,
    "mumps": partial(PetscCholesky, package="mumps"),
    "cholmod": partial(PetscCholesky, package="cholmod"),
    "pardiso": _pardiso,
    "superlu": SuperLU,
}
"""Makers of the solvers, in the order of the table; one raises UnavailableError if it cannot be
had."""
