"""A rank's rows of any PETSc matrix, to be multiplied with row-major blocks."""

from typing import Any

import numpy as np
import scipy.sparse as sp

from carillon.arrays import Array
from carillon.processes.mpi import MPI
from solver.assembly.halo import Halo
from solver.assembly.row_products import RowProducts

SIDE = 3
"""Rows and columns of a block; the levels of the multigrid have three or six unknowns a node."""


def block_rows(matrix: Any, comm: MPI.Comm, threads: int) -> RowProducts:
    """Copy this rank's rows of `matrix` (AIJ), whose sizes are multiples of three; collective."""
    start, stop = matrix.getOwnershipRangeColumn()
    indptr, columns, values = matrix.getValuesCSR()
    outside = (columns < start) | (columns >= stop)
    nodes = np.unique(columns[outside] // SIDE)
    ghosts = (SIDE * nodes[:, None] + np.arange(SIDE)).ravel()
    local = np.where(outside, stop - start + np.searchsorted(ghosts, columns), columns - start)
    shape = (len(indptr) - 1, stop - start + len(ghosts))
    blocks = sp.csr_matrix((values, local, indptr), shape=shape).tobsr((SIDE, SIDE))
    blocks.sort_indices()
    graph = blocks.indptr.astype(np.int64), blocks.indices.astype(np.int64)
    starts = np.array([*comm.allgather(start), comm.allreduce(stop - start)])
    halo = Halo(nodes, start // SIDE, starts // SIDE, comm)
    return RowProducts(graph, blocks.data, halo, threads)


def diagonal(rows: RowProducts) -> Array:
    """Diagonal (local,) of a square matrix of 3x3 blocks."""
    indptr, columns = rows.graph
    row = np.repeat(np.arange(rows.nodes), np.diff(indptr))
    return np.ascontiguousarray(np.einsum("nii->ni", rows.entries[columns == row])).ravel()
