"""Where the surface of a solid of finite cells lies, as far as the moments of its voxels tell."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.shapes import points


def centroids(cells: FiniteCells) -> tuple[Array, Array]:
    """Middles (m, 3) [m] of what is inside each voxel, and its covariances (m, 3, 3) [m^2]."""
    cell, octant = np.nonzero(cells.voxels >= 0)
    order = np.argsort(cells.voxels[cell, octant])
    cell, octant = cell[order], octant[order]
    weights = cells.weights[cells.row[cell], octant]
    places = 2.0 * points()
    volume = weights.sum(axis=1)
    middles = weights @ places / volume[:, None]
    squares = (places[:, :, None] * places[:, None, :]).reshape(len(places), -1)
    second = (weights @ squares / volume[:, None]).reshape(-1, 3, 3)
    covariance = second - middles[:, :, None] * middles[:, None, :]
    edge = cells.mesh.edge
    return cells.mesh.origin + edge * (cells.grid[cell] + middles), edge**2 * covariance


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
