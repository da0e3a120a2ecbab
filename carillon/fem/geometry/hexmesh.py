"""Hexahedral mesh of the filled voxels: uniform, or with elements of two sizes."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from carillon.fem.geometry.hanging import kinds_of_cells
from carillon.fem.geometry.voxels import VoxelModel

#: Offset of local corner c = x + 2*y + 4*z from the cell's lowest corner, shape (8, 3).
CORNER_OFFSETS = np.array([[c & 1, (c >> 1) & 1, (c >> 2) & 1] for c in range(8)], dtype=np.int32)


@dataclass(frozen=True, eq=False)
class HexMesh:
    """Cubes on an integer grid, and their nodes: of one edge length, with the nodes at the corners.

    In a mixed mesh, see `carillon.fem.geometry.blocks`, some cubes have twice the edge and start at
    even coordinates, and the others may have hanging corners, see `carillon.fem.geometry.hanging`.
    """

    cells: np.ndarray
    """(m, 8) int32: nodes of each cell; the bits of a local corner are its offset, x first."""
    grid: np.ndarray
    """(m, 3) int32: integer coordinates of the cells, ordered by (z, y, x); in a mixed mesh by
    blocks."""
    node_grid: np.ndarray
    """(n, 3) int32: integer coordinates of the nodes, ordered by (z, y, x)."""
    origin: np.ndarray
    """(3,) position of node coordinate (0, 0, 0) [m]."""
    edge: float
    """Edge of a cell [m], of the smaller ones in a mixed mesh."""
    span: np.ndarray | None = None
    """(m,) uint8: edge of each cell in steps of the grid, 1 or 2; None in a mesh of one edge
    length."""
    hanging: np.ndarray | None = None
    """(m,) uint8: bit c tells whether local corner c hangs; None likewise."""

    def __repr__(self) -> str:
        return f"<HexMesh: {self.n_cells:,} cells of {self.edge:.4g} m, {self.n_nodes:,} nodes>"

    @cached_property
    def nodes(self) -> np.ndarray:
        """Positions of the nodes (n, 3) [m]."""
        return self.origin + self.edge * self.node_grid

    @cached_property
    def kinds(self) -> np.ndarray | None:
        """Kinds (m,) of the cells of a mixed mesh, see `carillon.fem.geometry.hanging`."""
        if self.span is None or self.hanging is None:
            return None
        return kinds_of_cells(self.grid, self.span, self.hanging)

    @property
    def bounds(self) -> np.ndarray:
        """Lowest and highest corner (2, 3) [m] of the box around all cells."""
        corners = self.nodes[np.unique(self.cells)]
        return np.stack([corners.min(axis=0), corners.max(axis=0)])

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.node_grid)

    @property
    def n_dofs(self) -> int:
        """Three displacements per node."""
        return 3 * self.n_nodes

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return len(self.cells)

    @property
    def volume(self) -> float:
        """Volume of all cells [m^3]."""
        cubes = self.n_cells if self.span is None else int((self.span.astype(int) ** 3).sum())
        return cubes * self.edge**3


def hexmesh_from_grid(grid: np.ndarray, origin: np.ndarray, edge: float) -> HexMesh:
    """Mesh of the cells at integer coordinates `grid` (m, 3); cells and nodes ordered by (z, y, x).

    Only corners of the given cells become nodes.

    Examples
    --------
    >>> mesh = hexmesh_from_grid(np.array([[0, 0, 0], [1, 0, 0]]), np.zeros(3), 0.5)
    >>> mesh.n_nodes, mesh.cells[1].tolist()
    (12, [1, 2, 4, 5, 7, 8, 10, 11])
    """
    grid = np.asarray(grid, dtype=np.int64).reshape(-1, 3)
    grid = grid[np.lexsort(grid.T)]
    corners = grid[:, None, :] + CORNER_OFFSETS
    node_grid, cells = distinct_places(corners.reshape(-1, 3))
    return HexMesh(
        cells=cells.reshape(-1, 8).astype(np.int32),
        grid=grid.astype(np.int32),
        node_grid=node_grid,
        origin=np.asarray(origin, dtype=float),
        edge=float(edge),
    )


def distinct_places(places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distinct integer coordinates (d, 3) int32 by (z, y, x), and which each of `places` (n, 3) is.

    No coordinate is negative.

    Examples
    --------
    >>> distinct, number = distinct_places(np.array([[0, 0, 1], [1, 0, 0], [0, 0, 1]]))
    >>> distinct.tolist(), number.tolist()
    ([[1, 0, 0], [0, 0, 1]], [1, 0, 1])
    """
    # One 64-bit key per place: sorting keys is sorting by (z, y, x).
    nx, ny, _ = places.max(axis=0, initial=0).astype(np.int64) + 1
    keys, number = np.unique(places @ np.array([1, nx, nx * ny]), return_inverse=True)
    distinct = np.stack([keys % nx, keys // nx % ny, keys // (nx * ny)], axis=1)
    return distinct.astype(np.int32), number.ravel()


def hexmesh_from_voxels(voxels: VoxelModel) -> HexMesh:
    """Mesh of the filled voxels, with nodes only where a filled voxel has a corner.

    Examples
    --------
    >>> from carillon.fem.geometry import builtin_surface, voxelize
    >>> mesh = hexmesh_from_voxels(voxelize(builtin_surface("box"), 8))
    >>> mesh.n_dofs == 3 * mesh.n_nodes, mesh.cells.shape == (mesh.n_cells, 8)
    (True, True)
    """
    return hexmesh_from_grid(np.argwhere(voxels.filled), voxels.origin, voxels.edge)
