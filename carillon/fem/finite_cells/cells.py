"""The mesh of finite cells, and its voxels, which carry the material."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from carillon.arrays import Array, Index
from carillon.fem.finite_cells.basis import DEGREES, Basis, basis, voxel_places
from carillon.fem.finite_cells.hanging import places_of_kinds
from carillon.fem.geometry.hexmesh import HexMesh

FLOORS = {2: (1e-9, 1e-9), 4: (1e-10, 1e-14)}
"""Shares of a cell's stiffness and mass that it has where it is empty, by degree, which keep both
matrices definite wherever a surface may cut a cell (fictitious material; Duester et al. 2008). Its
mass is so little that what is empty has no slow motions of its own."""


def places_along(degree: int, level: int) -> int:
    """Voxels along an edge of a cell that is divided `level` times; 1 of one as small as a voxel.

    Quadratic cells keep two: their parts, then halves of a voxel.
    """
    return max(degree >> level, 4 // degree)


@dataclass(frozen=True, eq=False)
class FiniteCells:
    """Cells that cover a solid, what of them is inside, and the voxels that this lies in.

    An undivided cell spans as many voxels along an edge as its `degree`. Cells may be divided into
    eight of half the edge, several times; see `carillon.fem.finite_cells.hanging` for the nodes of
    those beside larger ones. Parts of a cell's inside that touch nowhere in it are cells of their
    own in the same place. Voxels, which carry the material, stay what they are when cells are
    divided.
    """

    degree: int
    """Polynomial degree of the shape functions, see `carillon.fem.finite_cells.basis`."""
    nodes: NDArray[np.int32]
    """(c, n) nodes of each cell, in the order of its basis."""
    corner: NDArray[np.int32]
    span: NDArray[np.int32]
    """(c, 3), (c,) lowest corner of each cell and its edge, in steps."""
    kinds: NDArray[np.int32]
    """(c,) which nodes are those of larger cells, see `carillon.fem.finite_cells.hanging`."""
    node_grid: NDArray[np.int32]
    """(n, 3) places of the nodes in steps, ordered by (z, y, x)."""
    step: float
    """Step of the lattice that nodes lie on [m]."""
    mesh: HexMesh
    """The voxels that hold material, ordered by (z, y, x), with corners of their own. The lattices
    of nodes and of voxels have one origin."""
    cell: NDArray[np.int32]
    place: NDArray[np.int32]
    voxel: NDArray[np.int32]
    row: NDArray[np.int32]
    """(e,) what cells have of voxels, ordered by cell: the cell; place of the voxel in it, x
    fastest, 0 of cells no larger than a voxel; the voxel; and the row of `weights`."""
    weights: Array
    """(k, d) integrals of the points' Lagrange polynomials over what is inside, for a cell of
    volume one."""
    line_weights: Array | None = None
    """(k, q^3) the same of `Basis.line_points`, which integrate polynomials of higher degree, for
    estimates of errors; None of cells in files."""

    def __len__(self) -> int:
        return len(self.nodes)

    @property
    def basis(self) -> Basis:
        """Shape functions of the cells."""
        return basis(self.degree)

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.node_grid)

    @property
    def origin(self) -> Array:
        """(3,) corner of the lattices [m]."""
        return np.asarray(self.mesh.origin)

    @cached_property
    def positions(self) -> Array:
        """Positions (n, 3) of the nodes [m]."""
        return self.origin + self.step * self.node_grid

    @property
    def edges(self) -> Array:
        """Edge (c,) of each cell [m]."""
        return np.asarray(self.step * self.span)

    @cached_property
    def levels(self) -> Index:
        """How many times (c,) each cell is divided."""
        return np.rint(np.log2(self._ratios)).astype(np.int64)

    @property
    def _ratios(self) -> Array:
        """Edge (c,) of an undivided cell over that of each."""
        return np.asarray(self.degree * self.mesh.edge / self.edges)

    @cached_property
    def counts(self) -> Index:
        """Voxels (c,) along an edge of each cell, see `places_along`."""
        return np.array([places_along(self.degree, int(level)) for level in self.levels])

    def frames(self) -> tuple[Array, Array]:
        """Lowest corners (e, 3) and edges (e,), in cells, of the voxels that portions are of."""
        counts = self.counts[self.cell]
        low = np.empty((len(self.cell), 3))
        for count in np.unique(counts):
            chosen = counts == count
            low[chosen] = voxel_places(int(count))[self.place[chosen]] / count
        return low, 1.0 / counts

    @cached_property
    def shares(self) -> Array:
        """Share (e,) of the cell that each part of a voxel is."""
        return np.asarray(self.weights.sum(axis=1)[self.row])

    @cached_property
    def fractions(self) -> Array:
        """Share (c,) of each cell that is inside."""
        return np.asarray(np.bincount(self.cell, self.shares, minlength=len(self)), dtype=float)

    def voxel_shares(self) -> Array:
        """Share (m,) of each voxel's volume that is inside."""
        volumes = self.shares * self.edges[self.cell] ** 3
        inside = np.bincount(self.voxel, volumes, minlength=self.mesh.n_cells)
        return np.asarray(inside / self.mesh.edge**3)

    @property
    def volume(self) -> float:
        """Volume inside [m^3]."""
        return float((self.fractions * self.edges**3).sum())

    @cached_property
    def neighbours(self) -> Index:
        """Pairs (p, 2) of cells that share a face, or a part of one."""
        middles = self.nodes[:, self.basis.middles]
        found = [np.empty((0, 2), dtype=np.int64)]
        for axis in range(3):
            upper, lower = middles[:, 2 * axis + 1], middles[:, 2 * axis]
            order = np.argsort(lower, kind="stable")
            first, last = (np.searchsorted(lower[order], upper, side=s) for s in ("left", "right"))
            above = np.repeat(np.arange(len(self)), last - first)
            start = np.repeat(first - np.cumsum(last - first) + (last - first), last - first)
            below = order[start + np.arange(len(above))]
            found.append(np.stack([above, below], axis=1))
        return np.concatenate(found)

    def point_values(self, values: Array, floor: float) -> Array:
        """Weighted values (c, d) at the points of cells, from those (m,) of the voxels.

        A cell has, all over, a share `floor` of the mean over what is inside.
        """
        given = values[self.voxel]
        shape = (len(self), len(self.weights))
        matrix = sp.csr_matrix(
            (given, self.row, np.searchsorted(self.cell, range(len(self) + 1))), shape
        )
        mean = np.bincount(self.cell, given * self.shares, minlength=len(self)) / self.fractions
        return np.asarray(matrix @ self.weights) + (floor * mean)[:, None] * self.basis.whole

    def is_consistent(self) -> bool:
        """Whether nodes lie at their places, and cells, nodes and voxels have one another."""
        if self.degree not in DEGREES or not len(self):
            return False
        if not np.array_equal(np.unique(self.nodes), np.arange(self.n_nodes)):
            return False
        if self.voxel.min(initial=0) < 0 or self.voxel.max(initial=-1) >= self.mesh.n_cells:
            return False
        if not np.array_equal(np.unique(self.cell), np.arange(len(self))):
            return False
        if (np.diff(self.cell) < 0).any() or (self.row < 0).any():
            return False
        if (self.row >= len(self.weights)).any() or (self.span <= 0).any():
            return False
        if (self.span % self.degree).any() or (self.corner % self.span[:, None]).any():
            return False
        if np.abs(self._ratios / 2.0**self.levels - 1.0).max() > 1e-9 or self.levels.min() < 0:
            return False
        if (self.place < 0).any() or (self.place >= self.counts[self.cell] ** 3).any():
            return False
        scale = (self.span // self.degree)[:, None, None]
        places = self.corner[:, None] + scale * places_of_kinds(self.degree, self.kinds)
        return np.array_equal(self.node_grid[self.nodes], places) and bool((self.shares > 0).all())


def middles_of_portions(cells: FiniteCells) -> tuple[Array, Array]:
    """Middles (e, 3) [m] of what cells have of voxels, and its covariances (e, 3, 3) [m^2]."""
    points = cells.basis.points
    edge = cells.edges[cells.cell]
    local = (cells.weights @ points)[cells.row] / cells.shares[:, None]
    squares = (points[:, :, None] * points[:, None, :]).reshape(len(points), -1)
    second = ((cells.weights @ squares)[cells.row] / cells.shares[:, None]).reshape(-1, 3, 3)
    spread = second - local[:, :, None] * local[:, None, :]
    middle = cells.origin + cells.step * cells.corner[cells.cell] + edge[:, None] * local
    return middle, (edge**2)[:, None, None] * spread


def middles_of_voxels(cells: FiniteCells) -> tuple[Array, Array]:
    """Middles (m, 3) [m] of what is inside each voxel, and its covariances (m, 3, 3) [m^2]."""
    middle, spread = middles_of_portions(cells)
    volume = cells.shares * cells.edges[cells.cell] ** 3
    count = cells.mesh.n_cells
    total = np.bincount(cells.voxel, volume, minlength=count)
    empty = total == 0.0  # slivers that finer lines miss
    total[empty] = 1.0
    joined = _sums(cells.voxel, volume[:, None] * middle, count) / total[:, None]
    joined[empty] = cells.origin + cells.mesh.edge * (cells.mesh.grid[empty] + 0.5)
    apart = middle - joined[cells.voxel]
    spread += apart[:, :, None] * apart[:, None, :]
    summed = _sums(cells.voxel, (volume[:, None, None] * spread).reshape(-1, 9), count)
    return joined, (summed / total[:, None]).reshape(-1, 3, 3)


def _sums(group: NDArray[np.integer], values: Array, count: int) -> Array:
    """Sums (count, k) of values (e, k) by group (e,)."""
    columns = [np.bincount(group, column, minlength=count) for column in values.T]
    return np.stack(columns, axis=1)


def surface_points(cells: FiniteCells, voxels: NDArray[np.integer], outward: Array) -> Array:
    """Points (s, 3) [m] where lines through the middles of `voxels` (s,) leave the solid.

    They go along `outward` (s, 3), unit vectors, as far as in a slab across them with the voxel's
    second moment: sqrt(3 n^T C n), which is exact for faces along the lattice.

    Examples
    --------
    >>> from carillon.fem.finite_cells.build import finite_cells
    >>> from carillon.fem.geometry.builtin import builtin_surface
    >>> surface = builtin_surface("box")
    >>> cells = finite_cells(surface, 5)
    >>> top = cells.mesh.n_cells - 1
    >>> place = surface_points(cells, np.array([top]), np.array([[0.0, 0.0, 1.0]]))
    >>> bool(abs(place[0, 2] - surface.bounds[1, 2]) < 1e-9)
    True
    """
    middles, covariance = middles_of_voxels(cells)
    variance = np.einsum("si,sij,sj->s", outward, covariance[voxels], outward)
    reach = np.sqrt(3.0 * np.maximum(variance, 0.0))
    return np.asarray(middles[voxels] + reach[:, None] * outward)


def merged(cells: FiniteCells) -> FiniteCells:
    """One cell in place of all cells that have the same nodes; it has the voxels of each."""
    same, first, number = np.unique(cells.nodes, axis=0, return_index=True, return_inverse=True)
    if len(same) == len(cells):
        return cells
    # In the order of the first ones.
    order = np.argsort(first)
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    kept, cell = first[order], rank[number.ravel()][cells.cell]
    by_cell = np.argsort(cell, kind="stable")
    return replace(
        cells,
        nodes=cells.nodes[kept],
        corner=cells.corner[kept],
        span=cells.span[kept],
        kinds=cells.kinds[kept],
        cell=cell[by_cell].astype(np.int32),
        place=cells.place[by_cell],
        voxel=cells.voxel[by_cell],
        row=cells.row[by_cell],
    )
