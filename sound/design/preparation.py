"""What a search needs, from a project: targets, mesh, material and objective."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from carillon.errors import UserError
from carillon.fem.geometry.surface import load_surface, surface_name
from carillon.runtime import allowed_cores
from solver.analysis.problem import discretised
from sound.clips.files import extract_file
from sound.clips.targets import Targets, share_frequencies
from sound.design.material import ReducedMaterial
from sound.design.objective import Objective
from sound.design.poisson import FreePoisson
from sound.design.pool import Setting
from sound.project.design import Design
from sound.project.project import Project
from sound.project.usable import usable_strikes

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DesignProblem:
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
        If a clip is unusable, or all together have fewer modes than the project asks for, or
        than a design needs.
    """
    sounds = [
        extract_file(target.clip, target.modes, True, target.allow_clipped)
        for target in project.targets
    ]
    return share_frequencies([target.name for target in project.targets], sounds, project.modes)


def prepare(project: Project, targets: Targets | None = None) -> DesignProblem:
    """Mesh, material and objective of a project, whose `modes` are then a number.

    Parameters
    ----------
    targets
        What its points shall sound like; from its clips if not given.

    Raises
    ------
    UserError
        For anything wrong with the mesh, the points, the clips or the numbers.  What is wrong
        with targets is told of all of them, before any clip is searched.
    """
    solid = project.solid
    surface = project.surface()
    if targets is None:
        strikes = usable_strikes(project, surface)
        targets = targets_of(project)
    else:
        strikes = project.strikes(surface)
    project = replace(project, modes=len(targets.frequencies))
    objective = Objective(targets, project.weights)
    name = surface_name(solid.mesh)
    # Not the struck surface, whose cuts round: the voxels shall be those of the solver.
    mesh, cells = discretised(load_surface(solid.mesh, solid.unit), solid, name)
    wanted, bounds = project.material, project.material.poisson_bounds
    free_poisson = None if bounds is None else FreePoisson(bounds[0], bounds[1], solid.poisson)
    material = ReducedMaterial.of_mesh(
        mesh, wanted.dimensions, wanted.young, wanted.law, free_poisson
    )
    whole = None if cells is None else cells.cells
    setting = Setting(mesh, solid, material, strikes, objective, whole)
    return DesignProblem(project, np.asarray(surface.vertices), np.asarray(surface.faces), setting)


def require_same_voxels(problem: DesignProblem, initial: Design) -> None:
    """Check that a project can go on from an initial design.

    Raises
    ------
    UserError
        If the initial design is of other voxels.
    """
    mesh = problem.setting.mesh
    if not np.array_equal(initial.fine_grid, mesh.grid):
        raise UserError(
            f"the design to go on from has {len(initial.fine_grid):,} voxels, the project another "
            f"mesh of {mesh.n_cells:,}; begin a new design under another name"
        )


def coordinates_of(problem: DesignProblem, initial: Design) -> Array:
    """Coordinates (m,) whose material is that of an initial design, as near as may be.

    Raises
    ------
    UserError
        If the initial design is of other voxels.
    """
    require_same_voxels(problem, initial)
    material = problem.setting.material
    before = initial.settings.get("material", {})
    wanted = problem.project.material
    same = (before.get("law"), before.get("poisson_bounds")) == (wanted.law, wanted.poisson_bounds)
    if same and len(initial.coordinates) == material.dimensions:
        return initial.coordinates
    return material.coordinates(initial.young, initial.model.poisson)
