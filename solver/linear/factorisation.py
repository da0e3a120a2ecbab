"""Sparse Cholesky and LDL^T factorisations by what this PETSc offers."""

from __future__ import annotations

from collections.abc import Mapping

from carillon.errors import ConvergenceError, UserError, on_all_ranks
from carillon.processes.petsc import PETSc

ROOM = (50, 200, 800)
"""Percentages by which the memory exceeds MUMPS's guess, tried one after the other. Pivots that
have to wait are in no guess, and on several ranks their number differs between runs."""
_ROOM = 14
"""MUMPS's control of that percentage."""
_TOO_LITTLE_ROOM = (-8, -9, -17, -20)
"""Values of MUMPS's INFOG(1) if the memory was too little."""


@on_all_ranks()
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

    Parameters
    ----------
    matrix
        Symmetric, and said to be positive definite if it is, which spares the pivoting.
    controls
        MUMPS's ICNTL by their numbers.
    prefix
        Of options that may overrule this.

    Raises
    ------
    UserError
        On several ranks without MUMPS.
    ConvergenceError
        If the factorisation fails.
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


def _failure(matrix: PETSc.Mat, cause: str) -> ConvergenceError:
    return ConvergenceError(
        f"the sparse factorisation of {matrix.getSize()[0]:,} unknowns failed ({cause}); with too "
        "little memory use more ranks on more machines, or --linear-solver amg-cg"
    )
