"""How many unknowns a solid has, from its voxels, or from a count where its mesh is absent."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from carillon.fem.geometry import blocks_from_mesh, hexmesh_from_voxels, load_surface, voxelize
from workflow.settings import BUILTIN

TYPICAL_FINE, TYPICAL_COARSE = 0.8, 0.15
"""Unknowns of a compact solid such as the Stanford bunny on the fine and the coarse mesh, over the
cube of the voxels along its longest side."""


LARGEST_COUNTED = 128
"""Resolution from which on voxels are no longer made to be counted, which would take gigabytes."""


@dataclass(frozen=True)
class Size:
    """Unknowns of a solid on its fine mesh and on that of its blocks, and where they are from."""

    fine: int
    coarse: int
    basis: str


@dataclass(frozen=True)
class Solid:
    """What decides about the size: mesh argument of the solver, voxels along the longest side."""

    mesh: str
    resolution: int
    fill: str = "winding"
    components: str = "error"


Sizes = Callable[[Solid], Size]


@cache
def size_of(solid: Solid) -> Size:
    """Unknowns of a solid: counted on its voxels if the mesh is there.

    Raises
    ------
    UserError
        If the mesh cannot be voxelised so.
    """
    if not solid.mesh.startswith(BUILTIN) and not Path(solid.mesh).is_file():
        cube = solid.resolution**3
        fine, coarse = round(TYPICAL_FINE * cube), round(TYPICAL_COARSE * cube)
        return Size(fine, coarse, f"guessed, {solid.mesh} is absent: as compact as the bunny")
    if solid.resolution > LARGEST_COUNTED:
        counted = size_of(replace(solid, resolution=LARGEST_COUNTED))
        times = (solid.resolution / LARGEST_COUNTED) ** 3
        basis = f"{counted.basis} at resolution {LARGEST_COUNTED}, times {times:,.1f}"
        return Size(round(times * counted.fine), round(times * counted.coarse), basis)
    surface = load_surface(solid.mesh)
    voxels = voxelize(surface, solid.resolution, solid.fill, solid.components, solid.mesh)
    mesh = hexmesh_from_voxels(voxels)
    return Size(mesh.n_dofs, 3 * blocks_from_mesh(mesh).coarse.n_nodes, "counted on its voxels")
