"""Preparation of a search from a project: targets, mesh, material and objective."""

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Surface
from carillon.errors import UserError
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.geometry import HexMesh
from carillon.processes.threads import allowed_cores
from solver.analysis.problem import ProblemOptions, discretised
from solver.analysis.solid_surface import SolidSurface
from sound.clips.files import extract_file
from sound.clips.targets import Targets, share_frequencies, without_modes
from sound.clips.wav import read_wav
from sound.design.material import FreePoisson, ReducedMaterial
from sound.design.objective import Objective
from sound.design.tasks import Setting
from sound.project.design import Design
from sound.project.project import Project
from sound.project.settings import MaterialSettings
from sound.strikes import Strike


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
    function of coordinates; finite cells with these voxels, or None.
    """

    surface: Surface
    mesh: HexMesh
    material: ReducedMaterial
    cells: FiniteCells | None


def prepared_solid(
    solid: ProblemOptions, material: MaterialSettings, surface: Surface
) -> PreparedSolid:
    """Voxels and reduced material of a solid whose `surface` is struck.

    Raises UserError for anything wrong with the mesh or the numbers, or forests that are not for
    all Poisson's ratios that are free.
    """
    # Not the struck surface, whose cuts round: the voxels shall be those of the solver.
    loaded = SolidSurface.read(solid.mesh, solid.unit)
    mesh, cells = discretised(loaded, solid)
    loaded.doubt_unit()
    bounds = material.poisson_bounds
    for ratio in bounds or ():
        replace(solid, poisson=ratio).coarsening()  # which refuses ratios that it is not for
    free_poisson = None if bounds is None else FreePoisson(bounds[0], bounds[1], solid.poisson)
    reduced = ReducedMaterial.of_mesh(
        mesh, material.dimensions, material.young, material.law, free_poisson
    )
    return PreparedSolid(surface, mesh, reduced, None if cells is None else cells.cells)


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
        targets = targets_of(project)
    else:
        strikes = project.strikes(surface)
    project = replace(project, modes=len(targets.frequencies))
    objective = Objective(targets, project.weights)
    solid = solid or prepared_solid(project.solid, project.material, surface)
    setting = Setting(solid.mesh, project.solid, solid.material, strikes, objective, solid.cells)
    return DesignProblem(project, np.asarray(surface.vertices), np.asarray(surface.faces), setting)


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
    before = initial.settings.get("material", {})
    now = problem.project.material
    bounds = [
        None if each is None else tuple(each)
        for each in (before.get("poisson_bounds"), now.poisson_bounds)
    ]
    same = before.get("law") == now.law and bounds[0] == bounds[1]
    if same and len(initial.coordinates) == material.dimensions:
        return initial.coordinates
    return material.coordinates(initial.young, initial.model.poisson)


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
