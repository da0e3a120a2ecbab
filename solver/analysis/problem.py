"""From the names on a command line to a meshed solid with material."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.fem import geometry
from carillon.fem.element import DEFAULT_POISSON
from carillon.fem.geometry import HexMesh, hexmesh_from_voxels, voxelize
from carillon.fem.materials import young_modulus
from carillon.fem.model import DEFAULT_DENSITY, ElasticModel
from carillon.limits import require_constants
from dataset_gen.objectives import DEFAULT_OBJECTIVE
from solver.coarsening.coarsen import build_model
from solver.coarsening.trained import load_trained

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ProblemOptions:
    """The solid to analyse.

    Attributes
    ----------
    mesh
        Surface mesh file, or `builtin:NAME`.
    resolution
        Voxels along the longest side.
    material
        Name of a material or file with one modulus [Pa] per voxel.
    coarsen
        `none`, `average`, `galerkin`, `ddfem` or `fit`.
    forest
        File of forests for `ddfem`; None takes the default ones.
    objective
        Objective for `fit`.
    unit
        Metres per mesh unit.
    fill, pieces
        See `carillon.fem.geometry.voxelize`.
    poisson, density
        Poisson's ratio and mass density [kg/m^3].
    lumped
        Whether the mass is lumped.
    seed
        Seed of random materials.
    """

    mesh: str
    resolution: int
    material: str = "uniform"
    coarsen: str = "none"
    forest: str | None = None
    objective: str = DEFAULT_OBJECTIVE
    unit: float = 1.0
    fill: str = "winding"
    pieces: str = "error"
    poisson: float = DEFAULT_POISSON
    density: float = DEFAULT_DENSITY
    lumped: bool = False
    seed: int = 0

    def as_dict(self) -> dict[str, Any]:
        """Plain dictionary, for provenance."""
        return asdict(self)


@dataclass(frozen=True)
class Problem:
    """Fine mesh, its moduli (m,) [Pa], the model to solve, and how long making them took.

    `forest` tells which forests coarsened it; nothing if none did.
    """

    fine: HexMesh
    young: Array
    model: ElasticModel
    seconds: dict[str, float]
    forest: dict[str, str] = field(default_factory=dict)


def build_problem(options: ProblemOptions) -> Problem:
    """Voxelise the mesh, assign the material and coarsen.

    Raises
    ------
    UserError
        For anything wrong with the mesh, the material or the parameters.
    """
    require_constants(options.poisson, options.density)
    begin = time.perf_counter()
    surface = geometry.load_surface(options.mesh, options.unit)
    name = geometry.surface_name(options.mesh)
    voxels = voxelize(surface, options.resolution, options.fill, options.pieces, name)
    fine = hexmesh_from_voxels(voxels)
    meshed = time.perf_counter()
    label = f"mesh '{name}', resolution {options.resolution}"
    young = young_modulus(options.material, fine, options.seed, label)
    assigned = time.perf_counter()
    needs_forest = options.coarsen == "ddfem"
    forest = load_trained(options.forest, options.poisson) if needs_forest else None
    model = build_model(
        fine,
        young,
        options.coarsen,
        forest,
        options.objective,
        poisson=options.poisson,
        density=options.density,
        lumped=options.lumped,
    )
    seconds = {"mesh": meshed - begin, "material": assigned - meshed}
    if options.coarsen != "none":
        seconds["coarsening"] = time.perf_counter() - assigned
    return Problem(fine, young, model, seconds, forest.record() if forest else {})
