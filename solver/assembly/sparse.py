"""Sparse matrices from element matrices, block by block."""

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from carillon.arrays import Array
from carillon.fem.model import Solid


def sum_blocks(
    rows: NDArray[np.integer], columns: NDArray[np.integer], blocks: Array, shape: tuple[int, int]
) -> sp.csr_matrix:
    """Sparse matrix of the summed square `blocks` (k, b, b) at block positions `rows`, `columns`.

    `shape` counts blocks.  Duplicates are added in a fixed order, so the result is reproducible.
    """
    width = blocks.shape[-1]
    key = rows.astype(np.int64) * shape[1] + columns
    order = np.argsort(key, kind="stable")
    key = key[order]
    first = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]])) if len(key) else key
    if len(key) == 0:
        return sp.csr_matrix((shape[0] * width, shape[1] * width))
    data = np.add.reduceat(blocks[order], first, axis=0)
    row, column = np.divmod(key[first], shape[1])
    indptr = np.searchsorted(row, np.arange(shape[0] + 1))
    matrix = sp.bsr_matrix(
        (data, column, indptr), shape=(shape[0] * width, shape[1] * width), blocksize=(width, width)
    )
    return matrix.tocsr()


def node_blocks(matrices: Array) -> Array:
    """Element stiffness (c, 3 k, 3 k) as blocks (c, k, k, 3, 3) between nodes."""
    nodes = matrices.shape[1] // 3
    return matrices.reshape(-1, nodes, 3, nodes, 3).transpose(0, 1, 3, 2, 4)


def assemble_elements(
    cells: NDArray[np.integer], stiffness: Array, mass: Array, n_nodes: int
) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """Stiffness and mass (both on displacement unknowns) from element matrices.

    Parameters
    ----------
    cells
        (c, k) nodes of each element.
    stiffness, mass
        (c, 3 k, 3 k) and (c, k, k) element matrices.
    """
    nodes = cells.shape[1]
    rows = np.repeat(cells, nodes, axis=1).ravel()
    columns = np.tile(cells, (1, nodes)).ravel()
    shape = (n_nodes, n_nodes)
    stiff = sum_blocks(rows, columns, node_blocks(stiffness).reshape(-1, 3, 3), shape)
    nodal = sum_blocks(rows, columns, mass.reshape(-1, 1, 1), shape)
    return stiff, sp.kron(nodal, sp.identity(3), format="csr")


def assembled(model: Solid) -> tuple[sp.csr_matrix, sp.csr_matrix]:
    """Stiffness and mass of the whole model on one rank."""
    return assemble_elements(
        model.connectivity, model.stiffness(), model.nodal_mass(), model.n_nodes
    )
