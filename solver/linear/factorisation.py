"""Which sparse Cholesky factorisation this PETSc offers."""

from __future__ import annotations

from petsc4py import PETSc

from carillon.errors import UserError


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
