"""Factorisations of K and M that were assembled anew, to solve and to count with, on one rank.

By PETSc's packages, which the run that is audited may have done without.  Where PETSc is not
installed they are Carillon's own, of rows that are compared with K and M first.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from carillon.arrays import Array
from carillon.errors import ConvergenceError
from carillon.fem.block import degrees_of_freedom
from carillon.fem.model import Solid
from carillon.processes import extras
from carillon.processes.mpi import MPI
from solver.assembly.system import System, assemble, distributed_matrix
from solver.distribution.local_mesh import distribute
from solver.linear import LinearSolver
from solver.reference.truth import can_count, count_below

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

ROUNDING = 1e-10
"""Largest difference of two assembled matrices, relative to the largest entry."""

Solve = Callable[[Array], Array]
"""Solutions (n, k) for right-hand sides (n, k)."""


class Factored(ABC):
    """K and M (n, n), whose combinations are factorised."""

    def __init__(self, K: csr_matrix, M: csr_matrix) -> None:
        self._stiffness, self._mass = K, M

    @abstractmethod
    def inverse(self, shift: float) -> AbstractContextManager[Solve]:
        """(K + shift M)^-1 for a positive shift, in the body of a `with` statement."""

    @abstractmethod
    def count_below(self, value: float) -> int | None:
        """Eigenvalues of K - value M below zero, by inertia; None where they cannot be counted."""


def factored(model: Solid, K: csr_matrix, M: csr_matrix) -> Factored:
    """The matrices of a model, to be factorised by PETSc's packages where it is installed."""
    if extras.is_installed(extras.PETSC):
        return _ByPetsc(K, M)
    return _ByFronts(model, K, M)


class _ByPetsc(Factored):
    @contextmanager
    def inverse(self, shift: float) -> Iterator[Solve]:
        from carillon.processes.petsc import PETSc
        from solver.linear.factorisation import factorised, solve_dense

        matrix = distributed_matrix((self._stiffness + shift * self._mass).tocsr(), MPI.COMM_SELF)
        matrix.setOption(PETSc.Mat.Option.SPD, True)
        factorisation = factorised(matrix, {})

        def solve(block: Array) -> Array:
            right = np.asfortranarray(block)
            return solve_dense(factorisation.getFactorMatrix(), right, len(right), MPI.COMM_SELF)

        try:
            yield solve
        finally:
            factorisation.destroy()
            matrix.destroy()

    def count_below(self, value: float) -> int | None:
        if not can_count():
            return None
        from solver.linear.factorisation import count_negative

        K, M = (distributed_matrix(each, MPI.COMM_SELF) for each in (self._stiffness, self._mass))
        try:
            return count_negative(K, M, value)
        finally:
            K.destroy()
            M.destroy()


class _ByFronts(Factored):
    def __init__(self, model: Solid, K: csr_matrix, M: csr_matrix) -> None:
        super().__init__(K, M)
        alone = MPI.COMM_SELF
        self._system: System = assemble(distribute(model, 1, comm=alone), alone)
        self._dofs = degrees_of_freedom(self._system.nodes)
        rows, size = self._system.rows, self._system.n_dofs
        self._compare(rows.stiffness_csr(size), K)
        self._compare(rows.mass_csr(size), M)

    def _compare(self, rows: csr_matrix, expected: csr_matrix) -> None:
        """Raise ConvergenceError unless both are the same matrix."""
        difference = sp.csr_matrix(expected[self._dofs][:, self._dofs] - rows)
        if abs(difference).max() > ROUNDING * abs(expected).max():
            raise ConvergenceError("two ways to assemble the solid's matrices do not agree")

    @contextmanager
    def inverse(self, shift: float) -> Iterator[Solve]:
        inverse = LinearSolver("multifrontal", self._system.layout).inverse(self._system, -shift)

        def solve(block: Array) -> Array:
            solution = np.empty_like(block)
            solution[self._dofs] = inverse.solve(np.ascontiguousarray(block[self._dofs]))
            return solution

        yield solve

    def count_below(self, value: float) -> int:
        return count_below(self._system, value)
