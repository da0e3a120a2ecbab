"""From the names on a command line to a meshed solid with material."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import numpy as np

from carillon.arrays import Array
from carillon.composition.composition import PlacedRegions
from carillon.composition.entries import (
    CompositionEntry,
    Placed,
    SolidFrame,
    compose,
    describes_regions,
    read_composition,
)
from carillon.composition.supports import placed_supports
from carillon.errors import UserError
from carillon.fem import materials
from carillon.fem.elasticity import DEFAULT_POISSON
from carillon.fem.finite_cells.model import FiniteCellModel, finite_cell_model
from carillon.fem.geometry import HexMesh, hexmesh_from_voxels, voxelize
from carillon.fem.geometry.bridges import say_bridged
from carillon.fem.geometry.walls import WallSize
from carillon.fem.materials import UNIFORM_YOUNG, young_modulus
from carillon.fem.model import ElasticModel, Solid, fine_model
from carillon.fem.regions import DEFAULT_DENSITY, RegionOf, Regions
from carillon.parameters import REQUIRED, OneOf, option, parameters
from carillon.parameters.quantities import (
    Components,
    Density,
    Discretisation,
    Fill,
    MetresPerUnit,
    Number,
    PoissonRatio,
    Resolution,
    UpAxis,
    WallSide,
    WallThickness,
)
from dataset_gen.objectives import DEFAULT_OBJECTIVE, OBJECTIVES
from solver.analysis.solid_surface import SolidSurface
from solver.coarsening.choice import METHODS as COARSENINGS
from solver.coarsening.choice import make_coarsening
from solver.coarsening.coarsening import Coarsening
from solver.coarsening.forest import FOREST
from solver.coarsening.model import build_model

if TYPE_CHECKING:  # Its import takes long.
    from carillon.fem.finite_cells.cells import FiniteCells
    from carillon.fem.finite_cells.covering import Covering

Held = TypeVar("Held", bound=Solid)
DISCRETISATIONS = ("voxel", "finite-cell")
WALL_OF_VOXELS = (
    "found a wall of voxels, expected finite cells, which hold it as thick as it is; add "
    "--discretisation finite-cell, in a file discretisation: finite-cell, or leave out the wall"
)
"""Reason for refusing a wall where it cannot be."""
AUTO = "auto"
"""Name of the choice that is left to the program."""


@parameters
class ProblemOptions:
    """The solid to analyse."""

    mesh: str = option(
        REQUIRED, "surface mesh file, builtin:NAME, or YAML file of regions with a mesh each"
    )
    resolution: Resolution = option(REQUIRED)
    material: str = option(
        "uniform",
        f"{', '.join(materials.NAMES)}, or a file with one Young's modulus [Pa] per voxel",
        metavar="NAME|FILE",
    )
    coarsen: Annotated[str, OneOf(AUTO, *COARSENINGS)] = option(
        "none", f"coarsening of the blocks; {AUTO} is {FOREST} of voxels and none of finite cells"
    )
    forest: str | None = option(
        None, "forests for --coarsen ddfem (HDF5; default: those of the package)", metavar="FILE"
    )
    objective: Annotated[str, OneOf(*OBJECTIVES)] = option(
        DEFAULT_OBJECTIVE, "fit objective for --coarsen fit"
    )
    discretisation: Discretisation = option("voxel")
    wall: WallThickness | None = option(None, metavar="LENGTH")
    wall_side: WallSide = option("about")
    unit: MetresPerUnit = option(1.0)
    up: UpAxis | None = option(None)
    fill: Fill = option("winding")
    components: Components = option("error")
    poisson: PoissonRatio = option(DEFAULT_POISSON)
    density: Density = option(DEFAULT_DENSITY)
    regions: str | None = option(
        None, "YAML file with the regions of the solid and what holds it", metavar="FILE"
    )
    fix: tuple[str, ...] | None = option(
        None,
        "what is held: comparisons of x, y and z [m], or region:NAME; each where all of it is "
        "there",
        metavar="WHERE",
    )
    lumped: bool = option(False, "lump the mass")
    seed: Number = option(
        0, "of random materials, the partition, and the vectors that slepc and arpack start from"
    )

    def __post_init__(self) -> None:
        if self.coarsen == AUTO:
            suits = FOREST if self.discretisation == "voxel" else "none"
            object.__setattr__(self, "coarsen", suits)

        if self.wall is not None and self.discretisation != "finite-cell":
            raise ValueError(WALL_OF_VOXELS)

    @property
    def wall_size(self) -> WallSize | None:
        """The wall that the solid is; None if it is what the mesh encloses."""
        return None if self.wall is None else WallSize(self.wall, self.wall_side)

    def as_dict(self) -> dict[str, Any]:
        """Plain dictionary, for provenance."""
        return asdict(self)

    def coarsening(self, regions: Regions | None = None) -> Coarsening | None:
        """The coarsening of the blocks; None if the fine mesh itself is to be analysed.

        The `regions` of the solid have Poisson's ratios of their own. Raises UserError, see
        `solver.coarsening.choice.make_coarsening`.
        """
        ratios = (self.poisson,) if regions is None else regions.ratios
        return make_coarsening(self.coarsen, ratios, self.forest, self.objective)


@dataclass(frozen=True)
class Problem:
    """A solid in pieces, with its material, and the model to solve."""

    surface: SolidSurface
    fine: HexMesh
    """Voxels, those of finite cells too."""
    young: Array
    """(m,) Young's moduli [Pa] of the voxels."""
    model: Solid
    """What is solved: the voxels, coarse elements of them, or finite cells."""
    seconds: dict[str, float]
    region: RegionOf | None = None
    """(m,) region of each voxel; None if there is one."""
    composed: Placed = Placed(None, ())
    """Regions and supports, in any discretisation."""
    coarsening: dict[str, str] = field(default_factory=dict)
    """What the coarse elements rest on, see `Coarsening.record`."""
    covering: Covering | None = None

    def placed_on(self, cells: FiniteCells) -> PlacedRegions:
        """The regions as finite cells of the same solid have them."""
        if self.composed.composition is None:
            return PlacedRegions(self.model.regions)
        return self.composed.composition.of_cells(cells, complete=False)

    @property
    def regions(self) -> Regions:
        """Materials of the solid."""
        return self.model.regions

    @property
    def extents(self) -> tuple[float, ...]:
        """Sides (3,) of the box around the surface [m]."""
        return self.surface.extents

    @property
    def voxel_extents(self) -> tuple[float, ...] | None:
        """Sides (3,) of the box around the voxels [m]; None of finite cells."""
        if self.covering is not None:
            return None
        return tuple(float(side) for side in np.ptp(self.fine.nodes, axis=0))

    @property
    def hexahedra(self) -> ElasticModel:
        """The model, which is one of hexahedra."""
        assert isinstance(self.model, ElasticModel)
        return self.model

    @property
    def finite_cells(self) -> FiniteCellModel:
        """The model, which is one of finite cells."""
        assert isinstance(self.model, FiniteCellModel)
        return self.model


def build_problem(options: ProblemOptions, surface: SolidSurface | None = None) -> Problem:
    """Discretise the solid, assign the material and coarsen.

    The `surface` of the mesh that `options` name is read if not given. Raises UserError for
    anything wrong with the mesh, the material or the parameters.
    """
    begin = time.perf_counter()
    if surface is None:
        surface = SolidSurface.read(options.mesh, options.unit, options.wall_size, options.up)
    mesh, covering = discretised(surface, options)
    surface.hints.say_size_and_filling()
    meshed = time.perf_counter()
    label = f"mesh '{surface.name}', resolution {options.resolution}"
    young = young_modulus(options.material, mesh, options.seed, label, options.unit, options.up)
    composed = _composed(options, surface)
    placed = PlacedRegions(Regions.one(options.poisson, options.density))
    if composed.composition is not None:
        if covering is None:
            placed = composed.composition.of_voxels(mesh)
        else:
            placed = composed.composition.of_cells(covering.cells)
        young = placed.regions.moduli(placed.region, young / UNIFORM_YOUNG)
    assigned = time.perf_counter()
    seconds = {"mesh": meshed - begin, "material": assigned - meshed}
    whole = partial(Problem, surface, mesh, young, region=placed.region, composed=composed)
    if covering is not None:
        placing = placed.regions, placed.region, placed.shared
        cells = finite_cell_model(covering.cells, young, *placing)
        return whole(_held(cells, composed, surface), seconds, covering=covering)
    coarsening = options.coarsening(placed.regions)
    fine = fine_model(mesh, young, placed.region, regions=placed.regions, lumped=options.lumped)
    fine = _held(fine, composed, surface)
    if coarsening is None:
        return whole(fine, seconds)
    elements = build_model(mesh, young, coarsening, region=placed.region, **fine.constants)
    seconds["coarsening"] = time.perf_counter() - assigned
    return whole(elements, seconds, coarsening=coarsening.record())


def _composed(options: ProblemOptions, surface: SolidSurface) -> Placed:
    """Regions and supports that the options name."""
    entry, folder = CompositionEntry(), Path()
    described = options.regions
    if described is None and describes_regions(options.mesh):
        described = options.mesh
    if described is not None:
        entry, folder = read_composition(described), Path(described).parent
    given = (options.poisson, options.density) != (DEFAULT_POISSON, DEFAULT_DENSITY)
    if entry.regions and given:
        raise UserError(
            f"{described} has regions with Poisson's ratios and densities of their own; leave out "
            "--poisson and --density"
        )
    frame = SolidFrame(
        options.mesh, surface.triangles, surface.name, options.unit, folder, options.up
    )
    return compose(entry, frame, options.fix or ())


def _held(solid: Held, composed: Placed, surface: SolidSurface) -> Held:
    supports = placed_supports(composed.supports, solid, surface.triangles, surface.name)
    return solid if supports is None else solid.with_supports(supports)


def discretised(surface: SolidSurface, options: ProblemOptions) -> tuple[HexMesh, Covering | None]:
    """Voxels of a solid, and the covering by finite cells that they belong to, if there is one.

    Raises UserError if the surface or the options are of no use.
    """
    triangles, name = surface.triangles, surface.name
    match options.discretisation:
        case "voxel":
            voxels = voxelize(triangles, options.resolution, options.fill, options.components, name)
            say_bridged(triangles, voxels)
            return hexmesh_from_voxels(voxels), None
        case "finite-cell":
            from carillon.fem.finite_cells.build import covering  # Its import takes long.

            _require_nothing_for_voxels(options)
            cells = covering(surface.solid, options.resolution, options.components, name)
            return cells.cells.mesh, cells
        case other:
            raise UserError(
                f"discretisation {other!r} is unknown, expected one of {', '.join(DISCRETISATIONS)}"
            )


def _require_nothing_for_voxels(options: ProblemOptions) -> None:
    for given, what in (
        (options.coarsen != "none", f"--coarsen {options.coarsen}"),
        (options.lumped, "--lumped"),
        (options.fill != "winding", f"--fill {options.fill}"),
    ):
        if given:
            raise UserError(f"{what} is for voxels; leave it out with --discretisation finite-cell")
