"""Sparse LDL^T of K - shift M by MUMPS through PETSc, on any number of ranks."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.processes.petsc import PETSc
from solver.assembly.system import System
from solver.linear.factorisation import factorised
from solver.linear.petsc_options import INNER_PREFIX

Array = NDArray[np.float64]

COLUMNS = 128
"""Number of right-hand sides that MUMPS carries through its factor together."""
_BLOCKING, _ROOT_ON_ONE = 27, 13
"""MUMPS's controls of that, and of whether the root of the tree lies on one rank."""


class MumpsInverse:
    """Action of (K - shift M)^-1."""

    exact = True

    def __init__(self, system: System, shift: float) -> None:
        self.shift = shift
        self._system = system
        self._matrix = system.K.copy()
        self._matrix.axpy(-shift, system.M, structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
        # A negative shift makes the matrix definite, which spares the pivoting.
        option = PETSc.Mat.Option.SPD if shift < 0.0 else PETSc.Mat.Option.SYMMETRIC
        self._matrix.setOption(option, True)
        # Pivots of a root that several ranks share are not counted.
        controls = {_BLOCKING: COLUMNS, _ROOT_ON_ONE: 1} if shift > 0.0 else {_BLOCKING: COLUMNS}
        self._pc = factorised(self._matrix, controls, INNER_PREFIX)
        self._factor = self._pc.getFactorMatrix()
        self.negative = self._factor.getMumpsInfog(12) if shift > 0.0 else 0

    def solve(self, block: Array) -> Array:
        """Solutions for a row-major block of right-hand sides (local unknowns, k)."""
        rhs, out = np.asfortranarray(block), np.empty_like(block, order="F")
        matrices = [self._wrap(rhs), self._wrap(out)]
        self._factor.matSolve(*matrices)
        for matrix in matrices:
            matrix.destroy()
        return np.ascontiguousarray(out)

    def _wrap(self, block: Array) -> Any:
        """PETSc view of a column-major block, without a copy."""
        size = ((block.shape[0], self._system.n_dofs), (None, block.shape[1]))
        dense = PETSc.Mat().createDense(size, array=block, comm=self._system.comm)
        dense.assemble()
        return dense

    def destroy(self) -> None:
        """Free the factorisation."""
        self._pc.destroy()
        self._matrix.destroy()
