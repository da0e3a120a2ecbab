"""A design from its project: targets, search, and the analysis of what was found."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carillon.errors import UserError
from carillon.runtime import allowed_cores
from solver.geometry import hexmesh_from_voxels, voxelize
from solver.geometry.surface import surface_name
from sound.clips.files import extract_file
from sound.design.interrupts import interruptible
from sound.design.material import ReducedMaterial
from sound.design.objective import Objective
from sound.design.optimisers import OPTIMISERS
from sound.design.outcome import Outcome, require_modes
from sound.design.pool import Pool, Setting, Task
from sound.design.search import BudgetSpentError, Search
from sound.design_file import HISTORY_TYPE, Design
from sound.project import Project
from sound.targets import Targets, share_frequencies

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Prepared:
    """What a search needs: the surface, the setting and the project they follow from."""

    project: Project
    vertices: Array
    faces: NDArray[np.integer]
    setting: Setting

    @property
    def workers(self) -> int:
        """Processes that evaluate materials."""
        return self.project.optimiser.workers or allowed_cores()


def targets_of(project: Project) -> Targets:
    """Targets from the project's clips.

    Raises
    ------
    UserError
        If a clip is unusable, or all together have fewer modes than the project asks for.
    """
    sounds = [extract_file(target.clip, target.modes, True) for target in project.targets]
    return share_frequencies([target.name for target in project.targets], sounds, project.modes)


def prepare(project: Project, targets: Targets | None = None) -> Prepared:
    """Mesh, material and objective of a project.

    Parameters
    ----------
    targets
        What its points shall sound like; from its clips if not given.

    Raises
    ------
    UserError
        For anything wrong with the mesh, the points, the clips or the numbers.
    """
    solid = project.solid
    surface = project.surface()
    strikes = project.strikes(surface)
    objective = Objective(targets_of(project) if targets is None else targets, project.weights)
    name = surface_name(solid.mesh)
    mesh = hexmesh_from_voxels(voxelize(surface, solid.resolution, solid.fill, solid.pieces, name))
    material = ReducedMaterial.of_mesh(
        mesh, project.material.dimensions, project.material.young, project.material.law
    )
    setting = Setting(mesh, solid, material, strikes, objective)
    return Prepared(project, np.asarray(surface.vertices), np.asarray(surface.faces), setting)


def require_same_voxels(prepared: Prepared, former: Design) -> None:
    """Check that a project can go on from a former design.

    Raises
    ------
    UserError
        If the former design is of other voxels.
    """
    mesh = prepared.setting.mesh
    if not np.array_equal(former.fine_grid, mesh.grid):
        raise UserError(
            f"the design to go on from has {len(former.fine_grid):,} voxels, the project another "
            f"mesh of {mesh.n_cells:,}; begin a new design under another name"
        )


def coordinates_of(prepared: Prepared, former: Design) -> Array:
    """Coordinates (m,) whose material is that of a former design, as near as may be.

    Raises
    ------
    UserError
        If the former design is of other voxels.
    """
    require_same_voxels(prepared, former)
    material = prepared.setting.material
    same = former.settings.get("material") == prepared.project.as_dict()["material"]
    if same and len(former.coordinates) == material.dimensions:
        return former.coordinates
    return material.coordinates(former.young)


def design(
    prepared: Prepared,
    former: Design | None = None,
    keep: Callable[[Design], None] | None = None,
    keep_every: float = 30.0,
    watch: Callable[[Search], None] | None = None,
) -> Design:
    """Search for a material until the project's budget is spent, or somebody interrupts.

    What is found is never worse than what the search starts from, by analyses to `FINAL_TOLERANCE`.

    Parameters
    ----------
    prepared
        Of the project.
    former
        Design to go on from, of the same mesh; its targets may be others.
    keep
        Called with the design so far every `keep_every` seconds of the search.
    watch
        Called after every round of evaluations.

    Raises
    ------
    UserError
        See `coordinates_of`; or if the material to start from has no modes.
    """
    project, setting = prepared.project, prepared.setting
    z = np.zeros(setting.material.dimensions)
    before = (0.0, 0)
    rows = np.empty(0, HISTORY_TYPE)
    if former is not None:
        z = coordinates_of(prepared, former)
        rows = former.history
    if len(rows):
        before = (float(rows["seconds"][-1]), int(rows["evaluations"][-1]))
    outcome = Outcome(prepared, rows)
    budget = project.optimiser
    kept = time.monotonic()

    with interruptible() as interrupted:

        def look(search: Search) -> bool:
            nonlocal kept
            if watch is not None:
                watch(search)
            if keep is not None and time.monotonic() - kept >= keep_every and search.best:
                keep(outcome.of(search))
                kept = time.monotonic()
            return interrupted()

        search = Search(
            lambda: Pool(setting, prepared.workers),
            budget.seconds,
            budget.evaluations,
            look,
            before,
        )
        with search:
            try:
                search.run([Task(z)])
                require_modes(search)
                OPTIMISERS[budget.method](search, z, budget.seed, budget.population)
            except BudgetSpentError:
                pass
        return outcome.of(search)
