"""From a surface to voxels, hexahedra and 2x2x2 blocks."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from carillon.fem.geometry.blocks import Blocks, blocks_from_mesh, prolongation
from carillon.fem.geometry.hexmesh import (
    CORNER_OFFSETS,
    HexMesh,
    hexmesh_from_grid,
    hexmesh_from_voxels,
)
from carillon.fem.geometry.voxels import FILLS, PIECES, VoxelModel, voxelize

if TYPE_CHECKING:
    from carillon.fem.geometry.builtin import BUILTINS, builtin_surface
    from carillon.fem.geometry.surface import load_surface, surface_name

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

_OF_SURFACES = {
    "BUILTINS": "builtin",
    "builtin_surface": "builtin",
    "load_surface": "surface",
    "surface_name": "surface",
}


def __getattr__(name: str) -> Any:
    """What needs trimesh, loaded when first asked for: its import takes long."""
    if name in _OF_SURFACES:
        return getattr(import_module(f"carillon.fem.geometry.{_OF_SURFACES[name]}"), name)
    raise AttributeError(f"module 'carillon.fem.geometry' has no attribute {name!r}")
