"""From a surface to voxels, hexahedra and 2x2x2 blocks."""

from solver.geometry.blocks import Blocks, blocks_from_mesh, prolongation
from solver.geometry.builtin import BUILTINS, builtin_surface
from solver.geometry.hexmesh import (
    CORNER_OFFSETS,
    HexMesh,
    hexmesh_from_grid,
    hexmesh_from_voxels,
)
from solver.geometry.surface import load_surface, surface_name
from solver.geometry.voxels import FILLS, PIECES, VoxelModel, voxelize

__all__ = [
    "BUILTINS",
    "CORNER_OFFSETS",
    "FILLS",
    "PIECES",
    "Blocks",
    "HexMesh",
    "VoxelModel",
    "blocks_from_mesh",
    "builtin_surface",
    "hexmesh_from_grid",
    "hexmesh_from_voxels",
    "load_surface",
    "prolongation",
    "surface_name",
    "voxelize",
]
