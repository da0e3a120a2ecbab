"""The mesh of finite cells, and its voxels, which carry the material."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from carillon.fem.block import CELL_NODES, CORNER_NODES, NODES
from carillon.fem.finite_cells.hanging import corners_of, kinds_of_cells, node_places
from carillon.fem.finite_cells.shapes import octant_weights, points
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

    Some cells may be divided into eight of half the edge, which the steps of the lattice then are
    half of; see `carillon.fem.finite_cells.hanging` for their nodes. Each of these lies in one
    voxel.
    """

    nodes: np.ndarray
    """(c, 27) int32: nodes of each cell, in the order of `carillon.fem.block.NODES`."""
    voxels: np.ndarray
    """(c, 8) int32: voxel of each octant, in bit order; -1 where it is empty."""
    row: np.ndarray
    """(c,) int32: row of `weights` of each cell."""
    weights: np.ndarray
    """(k, 8, 125) integrals of the points' Lagrange polynomials over the inside of each octant, for
    a cell of volume one; row 0 is that of a cell all inside."""
    mesh: HexMesh
    """The voxels that hold material, ordered by (z, y, x), and all nodes."""

    def __len__(self) -> int:
        return len(self.nodes)

    @property
    def grid(self) -> np.ndarray:
        """Lowest lattice coordinates (c, 3) of the cells."""
        return np.asarray(self.mesh.node_grid[self.nodes[:, 0]])

    @property
    def span(self) -> np.ndarray:
        """Edge (c,) of each cell in steps of the lattice: 2, or 4 beside divided ones."""
        return np.asarray(self.mesh.node_grid[self.nodes[:, -1], 0] - self.grid[:, 0])

    @property
    def is_mixed(self) -> bool:
        """Whether there are cells of two sizes."""
        return self.mesh.span is not None

    @cached_property
    def kinds(self) -> np.ndarray | None:
        """Kinds (c,) of the cells, see `carillon.fem.finite_cells.hanging`; None if of one size."""
        if not self.is_mixed:
            return None
        places = self._places()
        own = NODES * (self.span // 2)[:, None, None]
        octants = (self.grid // self.span[:, None] % 2) @ np.array([1, 2, 4])
        return kinds_of_cells(octants, (places != own).any(axis=2))

    def _places(self) -> np.ndarray:
        return np.asarray(self.mesh.node_grid[self.nodes] - self.grid[:, None])

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
        octants = (self.span / 2.0 * self.mesh.edge) ** 3
        return float((self.fractions.sum(axis=1) * octants).sum())

    def is_consistent(self) -> bool:
        """Whether nodes lie at their places, voxels in their octants, and each is of some cell."""
        mesh, span = self.mesh, self.span
        cell, octant = np.nonzero(self.voxels >= 0)
        voxel = self.voxels[cell, octant]
        if not np.array_equal(np.unique(voxel), np.arange(mesh.n_cells)):
            return False
        if not np.array_equal(np.unique(self.nodes), np.arange(mesh.n_nodes)):
            return False
        if not np.isin(span, (2, 4) if self.is_mixed else (2,)).all():
            return False
        if (self.grid % span[:, None]).any():
            return False
        places = NODES if self.kinds is None else node_places(self.kinds)
        if not np.array_equal(self._places(), places * (span // 2)[:, None, None]):
            return False
        corners, grid = _voxels_of(self.nodes, self.grid, self.span, self.is_mixed)
        return (
            np.array_equal(mesh.cells[voxel], corners[cell, octant])
            and np.array_equal(mesh.grid[voxel], grid[cell, octant])
            and bool((self.fractions[self.voxels >= 0] > 0.0).all())
        )

    def hexmesh(self) -> HexMesh:
        """The cells as cubes with nodes at their corners, by which neighbours are found."""
        mesh, corners = self.mesh, self.nodes[:, CORNER_NODES]
        if self.kinds is None:
            return HexMesh(corners, self.grid // 2, mesh.node_grid, mesh.origin, 2 * mesh.edge)
        corners, hanging = corners_of(self.kinds, self.nodes)
        span = (self.span // 2).astype(np.uint8)
        grid = (self.grid // 2).astype(np.int32)
        return HexMesh(corners, grid, mesh.node_grid, mesh.origin, 2 * mesh.edge, span, hanging)

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
    is_mixed: bool = False,
) -> FiniteCells:
    """Finite cells with the voxels that follow from their weights."""
    grid = node_grid[nodes[:, 0]]
    span = node_grid[nodes[:, -1], 0] - grid[:, 0]
    corners, places = _voxels_of(nodes, grid, span, is_mixed)
    filled = (weights.sum(axis=2) > 0.0)[row]
    cell, octant = np.nonzero(filled)
    in_one = (span == 2) & is_mixed
    # One voxel for all octants of a cell that lies in it.
    first = filled.argmax(axis=1)
    own = np.where(in_one[cell], first[cell], octant)
    leads = np.flatnonzero(octant == own)
    order = leads[np.lexsort((cell[leads], *places[cell[leads], octant[leads]].T))]
    voxels = np.full(filled.shape, -1, dtype=np.int32)
    voxels[cell[order], octant[order]] = np.arange(len(order))
    voxels[cell, octant] = voxels[cell, own]
    sizes: tuple[np.ndarray, ...] = ()
    if is_mixed:
        sizes = np.full(len(order), 2, np.uint8), np.zeros(len(order), np.uint8)
    mesh = HexMesh(
        corners[cell[order], octant[order]].astype(np.int32),
        places[cell[order], octant[order]].astype(np.int32),
        node_grid.astype(np.int32),
        origin,
        edge,
        *sizes,
    )
    return FiniteCells(nodes.astype(np.int32), voxels, row.astype(np.int32), weights, mesh)


def _voxels_of(
    nodes: np.ndarray, grid: np.ndarray, span: np.ndarray, is_mixed: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Corners (c, 8, 8) and lattice coordinates (c, 8, 3) of the voxels of the cells' octants."""
    in_one = (is_mixed & (span == 2))[:, None, None]
    corners = np.where(in_one, nodes[:, None, CORNER_NODES], nodes[:, CELL_NODES])
    offsets = CORNER_OFFSETS * (span // 2)[:, None, None]
    return corners, grid[:, None] + np.where(in_one, 0, offsets)


def centroids(cells: FiniteCells) -> tuple[Array, Array]:
    """Middles (m, 3) [m] of what is inside each voxel, and its covariances (m, 3, 3) [m^2]."""
    cell, octant = np.nonzero(cells.voxels >= 0)
    order = np.argsort(cells.voxels[cell, octant], kind="stable")
    cell, octant = cell[order], octant[order]
    weights = cells.weights[cells.row[cell], octant]
    scale = cells.span[cell].astype(float)
    volume = weights.sum(axis=1)
    middles = scale[:, None] * (weights @ points() / volume[:, None])
    squares = (points()[:, :, None] * points()[:, None, :]).reshape(len(points()), -1)
    second = (scale**2 / volume)[:, None] * (weights @ squares)
    covariance = second.reshape(-1, 3, 3) - middles[:, :, None] * middles[:, None, :]
    middles = cells.grid[cell] + middles
    if cells.is_mixed:
        # A divided cell lies in one voxel, with all of its octants.
        voxel = cells.voxels[cell, octant]
        first = np.flatnonzero(np.diff(voxel, prepend=-1))
        share = volume * scale**3
        total = np.add.reduceat(share, first)
        joined = np.add.reduceat(share[:, None] * middles, first) / total[:, None]
        apart = middles - joined[voxel]
        covariance += apart[:, :, None] * apart[:, None, :]
        summed = np.add.reduceat(share[:, None, None] * covariance, first)
        middles, covariance = joined, summed / total[:, None, None]
    edge = cells.mesh.edge
    return cells.mesh.origin + edge * middles, edge**2 * covariance


def surface_points(cells: FiniteCells, voxels: NDArray[np.integer], outward: Array) -> Array:
    """Points (s, 3) [m] where lines through the middles of `voxels` (s,) leave the solid.

    They go along `outward` (s, 3), unit vectors, as far as in a slab across them with the voxel's
    second moment: sqrt(3 n^T C n), which is exact for faces along the lattice.

    Examples
    --------
    >>> from carillon.fem.finite_cells.build import finite_cells
    >>> from carillon.fem.geometry import builtin_surface
    >>> surface = builtin_surface("box")
    >>> cells = finite_cells(surface, 5)
    >>> top = cells.mesh.n_cells - 1
    >>> place = surface_points(cells, np.array([top]), np.array([[0.0, 0.0, 1.0]]))
    >>> bool(abs(place[0, 2] - surface.bounds[1, 2]) < 1e-9)
    True
    """
    middles, covariance = centroids(cells)
    variance = np.einsum("si,sij,sj->s", outward, covariance[voxels], outward)
    reach = np.sqrt(3.0 * np.maximum(variance, 0.0))
    return np.asarray(middles[voxels] + reach[:, None] * outward)
