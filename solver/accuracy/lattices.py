"""Lattices of a solid that nest: voxels of one are whole numbers of voxels of another."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from carillon.fem.finite_cells.build import covering
from carillon.fem.finite_cells.covering import Covering
from carillon.fem.geometry import HexMesh, hexmesh_from_voxels, voxelize
from carillon.fem.geometry.grid import Grid, bounding_grid

if TYPE_CHECKING:  # Its import takes long, and many commands need no surface.
    import trimesh

WHOLE = 4
"""Number of voxels along the edge of a finite cell at half the resolution."""


def voxel_lattice(surface: trimesh.Trimesh, resolution: int) -> Grid:
    """Lattice of the voxels of a surface, with empty ones up to whole cells of half the resolution.

    They follow at the far ends, so that the voxels of `voxel_mesh` are on it.
    """
    grid = bounding_grid(surface, resolution)
    nx, ny, nz = (-(-size // WHOLE) * WHOLE for size in grid.shape)
    return Grid(grid.origin, grid.edge, (nx, ny, nz))


def scaled(lattice: Grid, factor: float) -> Grid:
    """The lattice with `factor` voxels along the edge of each, or one in place of several.

    Examples
    --------
    >>> lattice = Grid(np.zeros(3), 0.5, (8, 4, 4))
    >>> scaled(lattice, 2).shape, scaled(lattice, 0.5).edge
    ((16, 8, 8), 1.0)
    """
    nx, ny, nz = (round(factor * size) for size in lattice.shape)
    return Grid(np.asarray(lattice.origin), lattice.edge / factor, (nx, ny, nz))


def voxel_mesh(surface: trimesh.Trimesh, resolution: int, components: str, name: str) -> HexMesh:
    """Voxels of a surface, see `carillon.fem.geometry.voxelize`."""
    return hexmesh_from_voxels(voxelize(surface, resolution, components=components, name=name))


def covering_on(surface: trimesh.Trimesh, lattice: Grid, components: str, name: str) -> Covering:
    """Finite cells on a lattice, see `carillon.fem.finite_cells.build.finite_cells`."""
    longest = float(np.ptp(surface.bounds, axis=0).max())
    return covering(surface, round(longest / lattice.edge), components, name, lattice)
