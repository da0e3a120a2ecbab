"""Sparse Cholesky, LDL^T and incomplete Cholesky factorisations by what this PETSc offers."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from carillon.arrays import Array
from carillon.errors import ConvergenceError, UserError, on_all_ranks
from carillon.processes.petsc import PETSc
from solver.assembly.system import System
from solver.linear.petsc_options import INNER_PREFIX

ROOM = (50, 200, 800)
"""Percentages by which the memory exceeds MUMPS's guess, tried one after the other. Pivots that
have to wait are in no guess, and on several ranks their number differs between runs."""
_TOO_LITTLE_ROOM = (-8, -9, -17, -20)
"""Values of MUMPS's INFOG(1) if the memory was too little."""
COLUMNS = 128
"""Number of right-hand sides that MUMPS carries through its factor together."""
_ROOM, _BLOCKING, _ROOT_ON_ONE, _NULL_PIVOTS = 14, 27, 13, 24
"""MUMPS's controls of these, of whether the root of the tree lies on one rank, and of whether it
looks for pivots that are zero."""
FILL_LEVELS = 0
"""Levels of fill of the factor; 0 keeps the pattern of the matrix."""


@on_all_ranks()
def factor_package(ranks: int) -> str:
    """PETSc's name of the sparse Cholesky to use: MUMPS, or PETSc's own on one rank without it.

    Raises UserError on several ranks without MUMPS.
    """
    if PETSc.Sys.hasExternalPackage("mumps"):
        return "mumps"
    if ranks == 1:
        return "petsc"
    raise UserError(
        "this PETSc was built without MUMPS, which a parallel factorisation needs; run on one rank "
        "or rebuild PETSc with MUMPS"
    )


def definite_packages(ranks: int) -> list[str]:
    """The same for positive definite matrices: the fastest, and what may do if that refuses.

    CHOLMOD is the faster one, but does not pivot.
    """
    alone = ranks == 1 and PETSc.Sys.hasExternalPackage("suitesparse")
    return [*(["cholmod"] if alone else []), factor_package(ranks)]


def factorised(
    matrix: PETSc.Mat, controls: Mapping[int, int], prefix: str | None = None
) -> PETSc.PC:
    """LDL^T of a symmetric matrix, to be destroyed by the caller; collective.

    Raises UserError on several ranks without MUMPS, and ConvergenceError if the factorisation
    fails.

    Parameters
    ----------
    matrix
        Symmetric, and said to be positive definite if it is, which spares the pivoting.
    controls
        MUMPS's ICNTL by their numbers.
    prefix
        Of options that may overrule this.
    """
    package = factor_package(matrix.comm.size)
    status = 0
    for room in ROOM:
        factorisation = PETSc.PC().create(matrix.comm)
        factorisation.setOptionsPrefix(prefix)
        factorisation.setOperators(matrix)
        factorisation.setType(PETSc.PC.Type.CHOLESKY)
        factorisation.setFactorSolverType(package)
        factorisation.setFactorSetUpSolverType()
        if package == "mumps":
            for control, value in {_ROOM: room, **controls}.items():
                factorisation.getFactorMatrix().setMumpsIcntl(control, value)
        if prefix is not None:
            factorisation.setFromOptions()
        try:
            factorisation.setUp()
        except PETSc.Error as error:
            raise _failure(matrix, str(error)) from None
        if package != "mumps":
            return factorisation
        # PETSc tells nobody before it solves.
        status = factorisation.getFactorMatrix().getMumpsInfog(1)
        if status >= 0:
            return factorisation
        factorisation.destroy()
        if status not in _TOO_LITTLE_ROOM:
            break
    raise _failure(matrix, f"MUMPS: INFOG(1) = {status}")


def solve_dense(factor: PETSc.Mat, block: Array, unknowns: int, comm: Any) -> Array:
    """Solutions (local, k), column-major as the right-hand sides are; collective."""
    solutions = np.empty_like(block)
    views = []
    for each in (block, solutions):
        size = ((len(each), unknowns), (None, each.shape[1]))
        views.append(PETSc.Mat().createDense(size, array=each, comm=comm))
        views[-1].assemble()
    factor.matSolve(*views)
    for view in views:
        view.destroy()
    return solutions


def count_negative(K: PETSc.Mat, M: PETSc.Mat, value: float) -> int:
    """Negative eigenvalues of K - value M, by Sylvester's law of inertia and MUMPS; collective.

    The arguments are K and M on any number of ranks. Raises UserError on several ranks without
    MUMPS, and ConvergenceError if the factorisation fails.
    """
    shifted = K.copy()
    shifted.axpy(-value, M, structure=PETSc.Mat.Structure.SUBSET_NONZERO_PATTERN)
    shifted.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    # Inertia needs the root of the elimination tree on one rank, and its null pivots detected.
    factorisation = factorised(shifted, {_ROOT_ON_ONE: 1, _NULL_PIVOTS: 1})
    negative, _, _ = factorisation.getFactorMatrix().getInertia()
    factorisation.destroy()
    shifted.destroy()
    return int(negative)


def _failure(matrix: PETSc.Mat, cause: str) -> ConvergenceError:
    return ConvergenceError(
        f"the sparse factorisation of {matrix.getSize()[0]:,} unknowns failed ({cause}); with too "
        "little memory use more ranks on more machines, or --linear-solver amg-cg"
    )


class MumpsInverse:
    """Action of (K - shift M)^-1 by sparse LDL^T, on any number of ranks; see `Inverse`."""

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
        system, rhs = self._system, np.asfortranarray(block)
        return np.ascontiguousarray(solve_dense(self._factor, rhs, system.n_dofs, system.comm))

    def destroy(self) -> None:
        """Free the factorisation."""
        self._pc.destroy()
        self._matrix.destroy()


class IncompleteCholesky:
    """PETSc's incomplete Cholesky factor of the rows and columns that this rank owns.

    On one rank that is the preconditioner of the paper's section 7.2.1, on several the block Jacobi
    of it: couplings between ranks are left out.  The matrix is scaled to a unit diagonal first.
    Where a pivot is not positive, PETSc repeats the factorisation with a larger and larger multiple
    of the identity added, which then stands in the same proportion to soft elements and stiff ones.
    """

    def __init__(self, matrix: Any) -> None:
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
        solution = right
        if right.size:
            solution = solve_dense(self._factor, right, len(right), PETSc.COMM_SELF)
        return np.multiply(self._scale, solution, order="C")

    def destroy(self) -> None:
        """Free the factor."""
        self._pc.destroy()
        self._block.destroy()
