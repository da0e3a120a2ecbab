"""Lattices of a solid that nest, and voxels on them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from carillon.fem.geometry import HexMesh, hexmesh_from_voxels, voxelize
from carillon.fem.geometry.grid import Grid

if TYPE_CHECKING:  # Its import takes long.
    import trimesh


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
