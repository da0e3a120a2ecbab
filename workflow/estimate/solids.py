"""How many unknowns a solid has: counted on coarse voxels, from volume and surface beyond."""

from __future__ import annotations

from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from carillon.builtin_names import BUILTIN_PREFIX
from carillon.errors import UserError
from carillon.fem.finite_cells.build import finite_cells
from carillon.fem.geometry import (
    HexMesh,
    blocks_from_mesh,
    hexmesh_from_voxels,
    load_surface,
    voxelize,
)
from carillon.fem.materials import young_modulus
from solver.refinement import work

TYPICAL = 0.8, 0.15
"""Unknowns of a compact solid such as the Stanford bunny on the fine and the coarse mesh, over the
cube of the voxels along its longest side."""

LARGEST_COUNTED = 32
"""Resolution up to which voxels are made and counted, which takes longer than the rest."""


class Size(NamedTuple):
    """Unknowns of a solid on its fine mesh and on that of its blocks, and where they are from.

    `in_full` are the materials with which the fine solid is solved in place of the coarse one.
    """

    fine: int
    coarse: int
    basis: str
    in_full: tuple[str, ...] = ()


class NamedSolid(NamedTuple):
    """What decides about the size: mesh argument of the solver, voxels along the longest side."""

    mesh: str
    resolution: int
    fill: str = "winding"
    components: str = "error"
    discretisation: str = "voxel"


@cache
def size_of(solid: NamedSolid) -> Size:
    """Unknowns of a solid: counted, scaled up from a coarser count, or guessed without its mesh.

    Raises
    ------
    UserError
        If the mesh cannot be voxelised so.
    """
    if not solid.mesh.startswith(BUILTIN_PREFIX) and not Path(solid.mesh).is_file():
        fine, coarse = (round(share * solid.resolution**3) for share in TYPICAL)
        return Size(fine, coarse, f"guessed, {solid.mesh} is absent: as compact as the bunny")
    if solid.resolution > LARGEST_COUNTED:
        # What is one piece with thick walls may be none on coarse voxels.
        with suppress(UserError):
            coarser = solid._replace(resolution=LARGEST_COUNTED, components="largest")
            unknowns, cells = _counted(coarser)
            growth = solid.resolution / LARGEST_COUNTED
            # A node for each cell grows with the volume, further ones with the surface.
            fine, coarse = np.rint(growth**3 * cells + growth**2 * (unknowns - cells))
            basis = f"{_basis(solid)} at resolution {LARGEST_COUNTED}, times "
            return Size(int(fine), int(coarse), f"{basis}{fine / unknowns[0]:,.1f}")
    (fine, coarse), _ = _counted(solid)
    return Size(int(fine), int(coarse), _basis(solid))


@cache
def is_followed(solid: NamedSolid, material: str, seed: int) -> bool:
    """Whether coarse elements follow a material; taken for granted where the mesh is absent.

    Voxels are no finer than those that are counted.
    """
    if not solid.mesh.startswith(BUILTIN_PREFIX) and not Path(solid.mesh).is_file():
        return True
    coarser = solid
    if solid.resolution > LARGEST_COUNTED:
        coarser = solid._replace(resolution=LARGEST_COUNTED, components="largest")
    try:
        cells = _voxels(coarser)
    except UserError:
        return True
    return work.is_followed(blocks_from_mesh(cells), young_modulus(material, cells, seed))


def _voxels(solid: NamedSolid) -> HexMesh:
    mesh, resolution, fill, components, _ = solid
    return hexmesh_from_voxels(voxelize(load_surface(mesh), resolution, fill, components, mesh))


def _basis(solid: NamedSolid) -> str:
    return f"counted on its {'voxels' if solid.discretisation == 'voxel' else 'finite cells'}"


@cache
def _counted(solid: NamedSolid) -> tuple[np.ndarray, np.ndarray]:
    """Unknowns on the fine and the coarse mesh, and what three a voxel inside would be.

    Finite cells have no coarse mesh; theirs counts as it is.
    """
    mesh, resolution, _, components, discretisation = solid
    if discretisation != "voxel":
        cut = finite_cells(load_surface(mesh), resolution, components, mesh)
        return np.full(2, cut.mesh.n_dofs), np.full(2, 3.0 * cut.fractions.sum())
    cells = _voxels(solid)
    unknowns = np.array([cells.n_dofs, 3 * blocks_from_mesh(cells).coarse.n_nodes])
    return unknowns, 3.0 * cells.n_cells * np.array([1.0, 0.125])
