"""From a surface to voxels, hexahedra and 2x2x2 blocks."""

from typing import TYPE_CHECKING

from carillon import lazy_exports
from carillon.builtin_names import BUILTIN_NAMES, BUILTIN_PREFIX
from carillon.fem.geometry.blocks import Blocks, blocks_from_mesh, blocks_with_coarse, prolongation
from carillon.fem.geometry.hexmesh import (
    CORNER_OFFSETS,
    HexMesh,
    hexmesh_from_grid,
    hexmesh_from_voxels,
)
from carillon.fem.geometry.voxels import COMPONENTS, FILLS, VoxelModel, voxelize

if TYPE_CHECKING:
    from carillon.fem.geometry.builtin import BUILTINS, builtin_surface
    from carillon.fem.geometry.surface import load_surface, surface_name

# They need trimesh.
__getattr__ = lazy_exports.exports(
    __name__,
    {
        "BUILTINS": "builtin",
        "builtin_surface": "builtin",
        "load_surface": "surface",
        "surface_name": "surface",
    },
)
