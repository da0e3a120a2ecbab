"""Blocks of 2x2x2 fine cells, the coarse mesh they form, and the interpolation between both."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from carillon.fem.geometry.hexmesh import CORNER_OFFSETS, HexMesh, hexmesh_from_grid


@dataclass(frozen=True, eq=False)
class Blocks:
    """The coarse mesh over a fine one: a coarse cell per block that holds material.

    Attributes
    ----------
    fine
        The fine mesh.
    coarse
        Mesh of the blocks, edge twice the fine one, the same origin.
    fine_of_block : (mc, 8) int32
        Index of the fine cell at position ``x + 2*y + 4*z`` of its block, -1 where the block is
        void.
    """

    fine: HexMesh
    coarse: HexMesh
    fine_of_block: np.ndarray

    @property
    def mask(self) -> np.ndarray:
        """Which of a block's eight cells are filled, (mc, 8) bool."""
        return self.fine_of_block >= 0


def blocks_from_mesh(fine: HexMesh) -> Blocks:
    """Pair `fine` with its coarse mesh; a block starts at every even cell coordinate.

    Examples
    --------
    >>> fine = hexmesh_from_grid(np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]]), np.zeros(3), 0.5)
    >>> blocks = blocks_from_mesh(fine)
    >>> blocks.coarse.n_cells, blocks.fine_of_block[:, :2].tolist()
    (2, [[0, 1], [2, -1]])
    """
    coarse = hexmesh_from_grid(
        np.unique(fine.grid >> 1, axis=0), origin=fine.origin, edge=2 * fine.edge
    )
    size = coarse.grid.max(axis=0).astype(np.int64) + 1
    stride = np.array([1, size[0], size[0] * size[1]])
    # Coarse cells are ordered by (z, y, x), hence by this key.
    block = np.searchsorted(coarse.grid @ stride, (fine.grid >> 1) @ stride)
    position = (fine.grid & 1) @ np.array([1, 2, 4])
    fine_of_block = np.full((coarse.n_cells, 8), -1, dtype=np.int32)
    fine_of_block[block, position] = np.arange(fine.n_cells, dtype=np.int32)
    return Blocks(fine=fine, coarse=coarse, fine_of_block=fine_of_block)


def prolongation(fine: HexMesh, coarse: HexMesh) -> sp.csr_matrix:
    """Trilinear interpolation from coarse to fine nodes, (n_fine_nodes, n_coarse_nodes).

    A fine node on a coarse node takes its value; on an edge, face or in the middle of a coarse
    cell, the mean of the 2, 4 or 8 coarse nodes around it. Displacements use
    ``scipy.sparse.kron(prolongation(fine, coarse), scipy.sparse.identity(3))``.

    Raises
    ------
    ValueError
        If `coarse` is not the mesh of the blocks of `fine`.
    """
    low = fine.node_grid.astype(np.int64) >> 1
    odd = fine.node_grid & 1
    size = np.maximum(low.max(axis=0), coarse.node_grid.max(axis=0)) + 2
    stride = np.array([1, size[0], size[0] * size[1]])
    keys = coarse.node_grid @ stride
    rows, columns = [], []
    for offset in CORNER_OFFSETS:
        # An even coordinate has one coarse neighbour along its axis, an odd one has two.
        use = np.flatnonzero((odd >= offset).all(axis=1))
        corner_keys = (low[use] + offset) @ stride
        position = np.minimum(np.searchsorted(keys, corner_keys), len(keys) - 1)
        if not np.array_equal(keys[position], corner_keys):
            raise ValueError("the coarse mesh does not cover the fine mesh")
        rows.append(use)
        columns.append(position)
    row, column = np.concatenate(rows), np.concatenate(columns)
    weight = 0.5 ** odd.sum(axis=1)[row]
    return sp.csr_matrix((weight, (row, column)), shape=(fine.n_nodes, coarse.n_nodes))
