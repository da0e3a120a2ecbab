"""Incomplete Cholesky factors as preconditioners of blocks of right-hand sides."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.processes.petsc import PETSc

Array = NDArray[np.float64]

FILL_LEVELS = 0
"""Levels of fill of the factor; 0 keeps the pattern of the matrix."""


class IncompleteCholesky:
    """PETSc's incomplete Cholesky factor of the rows and columns that this rank owns.

    On one rank that is the preconditioner of the paper's section 7.2.1, on several the block Jacobi
    of it: couplings between ranks are left out.  The matrix is scaled to a unit diagonal first.
    Where a pivot is not positive, PETSc repeats the factorisation with a larger and larger multiple
    of the identity added, which then stands in the same proportion to soft elements and stiff ones.
    """

    def __init__(self, matrix: Any) -> None:
        """`matrix` is a symmetric positive definite PETSc matrix (AIJ)."""
        # The diagonal block is not ours to change on several ranks.
        self._block = matrix.getDiagonalBlock().copy()
        diagonal = self._block.getDiagonal()
        diagonal.sqrtabs()
        diagonal.reciprocal()
        self._block.diagonalScale(diagonal, diagonal)
        self._scale = diagonal.getArray().copy()[:, None]
        diagonal.destroy()
        self._pc = PETSc.PC().create(PETSc.COMM_SELF)
        self._pc.setOperators(self._block)
        self._pc.setType(PETSc.PC.Type.ICC)
        self._pc.setFactorLevels(FILL_LEVELS)
        self._pc.setFactorOrdering(PETSc.Mat.OrderingType.NATURAL)
        self._pc.setFactorShift(PETSc.Mat.FactorShiftType.POSITIVE_DEFINITE)
        self._pc.setUp()
        self._factor = self._pc.getFactorMatrix()

    def apply(self, block: Array) -> Array:
        """Solution (local, k) with the factor for a block of right-hand sides (local, k)."""
        right = np.multiply(self._scale, block, order="F")
        solution = np.empty_like(right)
        if right.size:
            rhs, out = _dense(right), _dense(solution)
            self._factor.matSolve(rhs, out)
            rhs.destroy()
            out.destroy()
        return np.multiply(self._scale, solution, order="C")

    def destroy(self) -> None:
        """Free the factor."""
        self._pc.destroy()
        self._block.destroy()


def _dense(block: Array) -> Any:
    """PETSc view of a Fortran-ordered block on this rank alone, without a copy."""
    dense = PETSc.Mat().createDense(block.shape, array=block, comm=PETSc.COMM_SELF)
    dense.assemble()
    return dense
