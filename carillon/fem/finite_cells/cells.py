"""The mesh of finite cells, and its voxels, which carry the material."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carillon.fem.block import CELL_NODES, CORNER_NODES, NODES
from carillon.fem.finite_cells.shapes import octant_weights
from carillon.fem.geometry.hexmesh import CORNER_OFFSETS, HexMesh

FLOOR = 1e-9
"""Share of a cell's stiffness and mass that it has where it is empty, which keeps both matrices
definite wherever a surface may cut a cell (fictitious material; Duester et al. 2008). A wall of a
twentieth of the spacing is 2.5 % too stiff with 1e-7 and 0.03 % with 1e-9; with 1e-11 eigensolvers
lose digits."""


@dataclass(frozen=True, eq=False)
class FiniteCells:
    """Cells of twice the lattice's spacing, and what of them is inside.

    The 27 nodes of a cell are the corners of its eight octants. Parts of a cell's inside that touch
    nowhere in it are cells of their own in the same place, with the octants that they lie in.

    Attributes
    ----------
    nodes : (c, 27) int32
        Nodes of each cell, in the order of `carillon.fem.block.NODES`.
    voxels : (c, 8) int32
        Voxel of each octant, in bit order; -1 where it is empty.
    row : (c,) int32
        Row of `weights` of each cell.
    weights : (k, 8, 125)
        Integrals of the points' Lagrange polynomials over the inside of each octant, for a cell of
        volume one; row 0 is that of a cell all inside.
    mesh
        The voxels that hold material, ordered by (z, y, x), and all nodes.
    """

    nodes: np.ndarray
    voxels: np.ndarray
    row: np.ndarray
    weights: np.ndarray
    mesh: HexMesh

    def __len__(self) -> int:
        return len(self.nodes)

    @property
    def grid(self) -> np.ndarray:
        """Lowest lattice coordinates (c, 3) of the cells."""
        return np.asarray(self.mesh.node_grid[self.nodes[:, 0]])

    @property
    def is_whole(self) -> np.ndarray:
        """Which cells (c,) are all inside."""
        return np.asarray(self.row == 0)

    @property
    def fractions(self) -> np.ndarray:
        """Share (c, 8) of each octant's volume that is inside."""
        return np.asarray(8.0 * self.weights.sum(axis=2)[self.row])

    def voxel_shares(self) -> np.ndarray:
        """Share (m,) of each voxel's volume that is inside."""
        shares = np.empty(self.mesh.n_cells)
        there = self.voxels >= 0
        shares[self.voxels[there]] = self.fractions[there]
        return shares

    @property
    def volume(self) -> float:
        """Volume inside [m^3]."""
        return float(self.fractions.sum() * self.mesh.edge**3)

    def is_consistent(self) -> bool:
        """Whether nodes lie at their places, voxels in their octants, and each is of some cell."""
        mesh = self.mesh
        cell, octant = np.nonzero(self.voxels >= 0)
        voxel = self.voxels[cell, octant]
        if not np.array_equal(np.sort(voxel), np.arange(mesh.n_cells)):
            return False
        if not np.array_equal(np.unique(self.nodes), np.arange(mesh.n_nodes)):
            return False
        grid, octants = self.grid, self.nodes[:, CELL_NODES]
        return (
            not (grid & 1).any()
            and np.array_equal(mesh.node_grid[self.nodes], grid[:, None] + NODES)
            and np.array_equal(mesh.cells[voxel], octants[cell, octant])
            and np.array_equal(mesh.grid[voxel], grid[cell] + CORNER_OFFSETS[octant])
            and bool((self.fractions[self.voxels >= 0] > 0.0).all())
        )

    def hexmesh(self) -> HexMesh:
        """The cells as cubes with nodes at their corners, by which neighbours are found."""
        mesh, corners = self.mesh, self.nodes[:, CORNER_NODES]
        return HexMesh(corners, self.grid // 2, mesh.node_grid, mesh.origin, 2 * mesh.edge)

    def point_values(self, values: np.ndarray) -> np.ndarray:
        """Weighted values (c, 125) at the points of cells, from those (m,) of the voxels.

        A part of a cell that is empty has `FLOOR` of the mean over what is not.
        """
        of_octants = np.where(self.voxels >= 0, values[self.voxels], 0.0)
        whole = octant_weights().sum(axis=0)
        inside = self.weights[self.row]
        weighted = np.einsum("co,cop->cp", of_octants, inside)
        share = 8.0 * inside.sum(axis=2)
        mean = (of_octants * share).sum(axis=1) / share.sum(axis=1)
        return np.asarray(weighted + FLOOR * mean[:, None] * whole)


def assemble_cells(
    nodes: np.ndarray,
    node_grid: np.ndarray,
    row: np.ndarray,
    weights: np.ndarray,
    origin: np.ndarray,
    edge: float,
) -> FiniteCells:
    """Finite cells with the voxels that follow from their weights."""
    filled = (weights.sum(axis=2) > 0.0)[row]
    cell, octant = np.nonzero(filled)
    grid = node_grid[nodes[cell, CELL_NODES[octant, 0]]]
    order = np.lexsort((cell, *grid.T))
    voxels = np.full(filled.shape, -1, dtype=np.int32)
    voxels[cell[order], octant[order]] = np.arange(len(order))
    corners = nodes[cell[order, None], CELL_NODES[octant[order]]]
    mesh = HexMesh(
        corners.astype(np.int32),
        grid[order].astype(np.int32),
        node_grid.astype(np.int32),
        origin,
        edge,
    )
    return FiniteCells(nodes.astype(np.int32), voxels, row.astype(np.int32), weights, mesh)
