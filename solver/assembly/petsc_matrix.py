"""Matrices of PETSc, from rows that ranks hold."""

from __future__ import annotations

from typing import Any

import scipy.sparse as sp

from carillon.processes.petsc import PETSc


def distributed_matrix(rows: sp.csr_matrix, comm: Any) -> Any:
    """Symmetric PETSc matrix from this rank's rows (local, n), in blocks of three unknowns."""
    local, total = rows.shape
    csr = (
        rows.indptr.astype(PETSc.IntType),
        rows.indices.astype(PETSc.IntType),
        rows.data.astype(PETSc.ScalarType),
    )
    matrix = PETSc.Mat().createAIJ(((local, total), (local, total)), bsize=3, csr=csr, comm=comm)
    matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
    return matrix
