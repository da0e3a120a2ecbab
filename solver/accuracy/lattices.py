"""Finite cells on the lattice of a solid's voxels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from carillon.fem.finite_cells.build import covering
from carillon.fem.finite_cells.covering import Covering
from carillon.fem.geometry.grid import Grid, bounding_grid

if TYPE_CHECKING:  # Its import takes long, and many commands need no surface.
    import trimesh

WHOLE = 4
"""Number of voxels along the edge of a finite cell at half the resolution."""


def voxel_lattice(surface: trimesh.Trimesh, resolution: int) -> Grid:
    """Lattice of the voxels of a surface, with empty ones up to whole cells of half the resolution.

    They follow at the far ends, so that the voxels of the surface are on it.
    """
    grid = bounding_grid(surface, resolution)
    nx, ny, nz = (-(-size // WHOLE) * WHOLE for size in grid.shape)
    return Grid(grid.origin, grid.edge, (nx, ny, nz))


def covering_on(surface: trimesh.Trimesh, lattice: Grid, components: str, name: str) -> Covering:
    """Finite cells on a lattice, see `carillon.fem.finite_cells.build.finite_cells`."""
    longest = float(np.ptp(surface.bounds, axis=0).max())
    return covering(surface, round(longest / lattice.edge), components, name, lattice)
