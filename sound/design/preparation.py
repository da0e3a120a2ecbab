"""Preparation of a search from a project: targets, mesh, material and objective."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Surface
from carillon.composition.composition import PlacedRegions
from carillon.composition.entries import CompositionEntry, SolidFrame, compose
from carillon.composition.supports import placed_supports
from carillon.errors import UserError
from carillon.fem.elasticity import Elasticity
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.model import finite_cell_model
from carillon.fem.geometry import HexMesh
from carillon.fem.model import fine_model
from carillon.fem.regions import Regions
from carillon.fem.supports import Supports
from carillon.processes.threads import allowed_cores, one_thread
from solver.analysis.problem import AUTO, ProblemOptions, discretised
from solver.analysis.solid_surface import SolidSurface
from solver.files.modes_file import frequencies
from sound.clips.files import extract_file
from sound.clips.targets import Targets, share_frequencies, without_modes
from sound.clips.wav import read_wav
from sound.design.assignment import SolidSpectrum, assigned
from sound.design.constants import NOTHING, FreeConstants, free_density, free_poisson
from sound.design.elements import analysed_elements, coarsening_of
from sound.design.material import ReducedMaterial
from sound.design.objective import Objective
from sound.design.place import place_transfer
from sound.design.tasks import Setting
from sound.project.design import Design
from sound.project.project import Project
from sound.project.settings import MaterialSettings
from sound.radiation.transfer import Transfer
from sound.strikes import Strike

MODES = 40
"""Modes of a solid among which the partials of clips find theirs."""
STIFFER = 10.0
"""Stiffness of what holds the solid of a search, over that for the moduli that it starts from: a
design may raise them."""


@dataclass(frozen=True)
class DesignProblem:
    """A search to be run: project, surface and setting."""

    project: Project
    vertices: Array
    faces: NDArray[np.integer]
    setting: Setting

    @property
    def workers(self) -> int:
        """Number of processes that evaluate materials."""
        return self.project.optimiser.workers or allowed_cores()


def targets_of(project: Project) -> Targets:
    """Targets from the project's clips.

    Raises UserError if a clip is unusable, or all together have fewer modes than the project asks
    for, or than a design needs.
    """
    sounds = [
        without_modes(
            extract_file(target.clip, target.modes, True, target.allow_clipped), target.without
        )
        for target in project.targets
    ]
    return share_frequencies([target.name for target in project.targets], sounds, project.modes)


@dataclass(frozen=True)
class PreparedSolid:
    """The solid of a search, without targets: its struck surface, its voxels, and their moduli as a
    function of coordinates; finite cells with these voxels, or None; its regions and what holds it,
    if it has any, and whether that has springs or masses, which give the solid a scale of its own.
    """

    surface: Surface
    mesh: HexMesh
    material: ReducedMaterial
    cells: FiniteCells | None
    placed: PlacedRegions | None = None
    supports: Supports | None = None
    has_scale: bool = False

    def setting(
        self, options: ProblemOptions, strikes: Sequence[Strike], objective: Objective
    ) -> Setting:
        """The setting of a search that strikes some points of it."""
        return Setting(
            self.mesh,
            options,
            self.material,
            strikes,
            objective,
            self.cells,
            self.placed,
            self.supports,
        )


def prepared_solid(
    solid: ProblemOptions,
    material: MaterialSettings,
    surface: Surface,
    composition: CompositionEntry | None = None,
) -> PreparedSolid:
    """Voxels and reduced material of a solid whose `surface` is struck.

    Its regions and supports are those of the `composition`, whose files are as the working
    directory has them. Raises UserError for anything wrong with the mesh or the numbers, or forests
    that are not for all Poisson's ratios that are free.
    """
    # Not the struck surface, whose cuts round: the voxels shall be those of the solver.
    loaded = SolidSurface.read(solid.mesh, solid.unit, solid.wall_size, solid.up)
    mesh, cells = discretised(loaded, solid)
    loaded.hints.say_size_and_filling(for_file=True)
    finite = None if cells is None else cells.cells
    frame = SolidFrame(solid.mesh, loaded.triangles, loaded.name, solid.unit, up=solid.up)
    composed = compose(composition or CompositionEntry(), frame)
    table, placed = Regions.one(solid.poisson, solid.density), None
    young: float | Array = material.young
    if composed.composition is not None:
        made = composed.composition
        placed = made.of_voxels(mesh) if finite is None else made.of_cells(finite)
        table = placed.regions
        young = np.full(mesh.n_cells, 1.0) * table.moduli(placed.region)
    has_scale = any(
        part.spring is not None or part.pad is not None or part.mass for part in composed.supports
    )
    free = _free_constants(solid, material, table, has_scale)
    reduced = ReducedMaterial.of_mesh(
        mesh, material.dimensions, young, material.law, free, has_scale
    )
    supports = None
    if composed.supports:
        stiff = STIFFER * reduced.moduli(np.zeros(reduced.dimensions))
        finest = fine_model(mesh, stiff) if finite is None else finite_cell_model(finite, stiff)
        supports = placed_supports(composed.supports, finest, loaded.triangles, loaded.name)
    return PreparedSolid(surface, mesh, reduced, finite, placed, supports, has_scale)


def _free_constants(
    solid: ProblemOptions, material: MaterialSettings, table: Regions, has_scale: bool
) -> FreeConstants:
    coarsening_of(solid, table)
    free = FreeConstants(
        free_poisson(table, material.poisson_bounds, material.poisson_regions),
        free_density(table, material.density_bounds, material.density_regions, has_scale),
    )
    rows = [row for each in free.poisson for row in each.rows]
    for ratio in material.poisson_bounds or ():
        law = Elasticity.isotropic(ratio)
        laws = tuple(law if row in rows else own for row, own in enumerate(table.laws))
        coarsening_of(solid, replace(table, laws=laws))  # which refuses ratios that it is not for
    return free if len(free) else NOTHING


def prepare(
    project: Project, targets: Targets | None = None, solid: PreparedSolid | None = None
) -> DesignProblem:
    """Mesh, material and objective of a project, whose `modes` are then a number.

    The targets are those of the project's clips unless given, and so is its solid.  Raises
    UserError for anything wrong with the mesh, the points, the clips or the numbers.  The faults of
    all targets are named, before any clip is searched.
    """
    surface = project.surface() if solid is None else solid.surface
    if targets is None:
        strikes = usable_strikes(project, surface)
        place = project.listen.place(project.unit)
        if place is not None:
            place.require_far(np.asarray(surface.vertices))
        sought = targets_of(project)
    else:
        strikes, sought = project.strikes(surface), targets
    solid = solid or prepared_solid(project.solid, project.material, surface, project.composition)
    if targets is None and project.modes == AUTO:
        sought = assigned(sought, sought.shares, _spectrum(project, solid, strikes))
    targets = sought
    project = replace(project, modes=len(targets.frequencies))
    heard = _transfer(project, solid, targets)
    objective = Objective(targets, project.weights, absolute=solid.has_scale, heard=heard)
    setting = solid.setting(project.solid, strikes, objective)
    return DesignProblem(project, np.asarray(surface.vertices), np.asarray(surface.faces), setting)


def _transfer(project: Project, solid: PreparedSolid, targets: Targets) -> Transfer | None:
    """Transfer to the place where a project's design is heard, None without one."""
    place = project.listen.place(project.unit)
    if place is None:
        return None
    surface = solid.surface
    elements = analysed_elements(
        solid.mesh, project.solid, solid.cells, solid.placed, solid.supports
    )
    triangles = np.asarray(surface.vertices), np.asarray(surface.faces)
    return place_transfer(place, elements.model, triangles, targets.frequencies, project.mesh)


def _spectrum(project: Project, solid: PreparedSolid, strikes: Sequence[Strike]) -> SolidSpectrum:
    """The lowest modes of a solid of the material that the search starts from."""
    nothing: Any = None
    setting = solid.setting(project.solid, strikes, nothing)
    with one_thread():
        simulation = setting.simulation(modes=MODES)
        evaluation = simulation.evaluate(np.zeros(solid.material.dimensions))
    return SolidSpectrum(frequencies(evaluation.eigenvalues), evaluation.pushed)


_MEANING: dict[str, Any] = {
    "law": None,
    "poisson_bounds": None,
    "poisson_regions": [],
    "density_bounds": None,
    "density_regions": [],
}
"""Settings of the material that say what coordinates mean, with their values in old designs."""


def require_same_voxels(problem: DesignProblem, initial: Design) -> None:
    """Check that a project can go on from an initial design.

    Raises UserError if the initial design is of other voxels.
    """
    mesh = problem.setting.mesh
    if not np.array_equal(initial.fine_grid, mesh.grid):
        raise UserError(
            f"the design to go on from has {len(initial.fine_grid):,} voxels, the project another "
            f"mesh of {mesh.n_cells:,}; begin a new design under another name"
        )


def coordinates_of(problem: DesignProblem, initial: Design) -> Array:
    """Coordinates (m,) of the material nearest to that of an initial design.

    Raises UserError if the initial design is of other voxels.
    """
    require_same_voxels(problem, initial)
    material = problem.setting.material
    before, now = initial.settings, problem.project.as_dict()
    same = all(
        before.get("material", {}).get(key, default) == now["material"][key]
        for key, default in _MEANING.items()
    ) and all(before.get(key, []) == now[key] for key in ("regions", "supports"))
    if same and len(initial.coordinates) == material.dimensions:
        return initial.coordinates
    return material.coordinates(initial.young, initial.model.regions)


def usable_strikes(project: Project, surface: Surface) -> list[Strike]:
    """The points of a project's targets on its `surface`, all of which can be used.

    Raises UserError with a sentence for everything that is wrong with any target: names that
    several have, clips that are not there or no sound, points that are not on the surface.
    """
    counts = Counter(target.name for target in project.targets)
    faults = [
        f"{count} targets are named {name!r}; give each a name of its own"
        for name, count in counts.items()
        if count > 1
    ]
    faults += _unreadable_clips(project)
    try:
        strikes = project.strikes(surface)
    except UserError as error:
        faults += error.args
    if faults:
        raise UserError(*faults)
    return strikes


def _unreadable_clips(project: Project) -> list[str]:
    """A sentence for each clip that is no sound; several targets may have the same."""
    clips: dict[tuple[str, bool], list[str]] = {}
    for target in project.targets:
        clips.setdefault((target.clip, target.allow_clipped), []).append(repr(target.name))
    faults = []
    for (clip, allow_clipped), names in clips.items():
        try:
            read_wav(clip, allow_clipped)
        except UserError as error:
            faults.append(f"target{'s' * (len(names) > 1)} {', '.join(names)}: {error}")
    return faults
