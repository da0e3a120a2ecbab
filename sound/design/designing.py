"""A design from its project: targets, search, and the analysis of what was found."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.errors import UserError
from carillon.runtime import allowed_cores
from solver.geometry import hexmesh_from_voxels, voxelize
from solver.geometry.surface import surface_name
from solver.modes_file import frequencies
from sound.clips.files import extract_file
from sound.design.descent import cost_of
from sound.design.material import ReducedMaterial
from sound.design.objective import Objective
from sound.design.optimisers import OPTIMISERS
from sound.design.pool import Pool, Setting, Task
from sound.design.search import BudgetSpentError, Moment, Search
from sound.design_file import HISTORY_TYPE, Design
from sound.project import Project
from sound.targets import Targets, share_frequencies

Array = NDArray[np.float64]

FINAL_TOLERANCE = 1e-8
"""Relative error of the eigenvalues that a design is written with."""


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


def coordinates_of(prepared: Prepared, former: Design) -> Array:
    """Coordinates (m,) whose material is that of a former design, as near as may be.

    Raises
    ------
    UserError
        If the former design is of other voxels.
    """
    setting = prepared.setting
    if not np.array_equal(former.fine_grid, setting.mesh.grid):
        raise UserError(
            f"the design to go on from has {len(former.fine_grid):,} voxels, the project another "
            f"mesh of {setting.mesh.n_cells:,}; begin a new design under another name"
        )
    material = setting.material
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
        See `coordinates_of`; or if no material has modes.
    """
    project, setting = prepared.project, prepared.setting
    z = np.zeros(setting.material.dimensions)
    before = (0.0, 0)
    rows = np.empty(0, HISTORY_TYPE)
    if former is not None:
        z = coordinates_of(prepared, former)
        rows = former.history
        before = (float(rows["seconds"][-1]), int(rows["evaluations"][-1]))
    budget = project.optimiser
    kept = time.monotonic()

    with _interruptible() as interrupted:

        def look(search: Search) -> bool:
            nonlocal kept
            if watch is not None:
                watch(search)
            if keep is not None and time.monotonic() - kept >= keep_every and search.best:
                keep(_finished(prepared, search, rows))
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
                OPTIMISERS[budget.method](search, z, budget.seed, budget.population)
            except BudgetSpentError:
                pass
    return _finished(prepared, search, rows)


def _finished(prepared: Prepared, search: Search, former_rows: NDArray[np.void]) -> Design:
    """The design at the best material, analysed to `FINAL_TOLERANCE`."""
    setting, best = prepared.setting, search.best
    if best is None or not np.isfinite(best.cost.total):
        raise UserError(
            "no material had modes that could be computed; expected a solid whose parts hang "
            "together, raise resolution"
        )
    simulation = setting.simulation(FINAL_TOLERANCE)
    found = simulation.evaluate(best.z, best.start)
    targets = setting.objective.targets
    factor = float((targets.frequencies[0] / frequencies(found.eigenvalues)[0]) ** 2)
    moduli = setting.material.moduli(best.z)
    cost = cost_of(setting.objective, setting.material, found)
    rows = np.concatenate([former_rows, history_rows(search.history)])
    seconds, evaluations = search.own_seconds, search.own_evaluations
    evidence: dict[str, Any] = {
        "method": prepared.project.optimiser.method,
        "workers": prepared.workers,
        "cost_start": search.history[0].cost.total,
        "cost": cost.total,
        "frequency_cost": cost.frequency,
        "amplitude_cost": cost.amplitude,
        "seconds": seconds,
        "evaluations": evaluations,
        "evaluations_per_minute": 60.0 * evaluations / seconds,
        "scale_of_moduli": factor,
        "residual_max": found.modes.evidence["residual_max"],
        "orthogonality": found.modes.evidence["orthogonality"],
        "eigenvalue_error_estimate": found.modes.evidence["eigenvalue_error_estimate"],
        "n_dofs": simulation.model.n_dofs,
    }
    return Design(
        strikes=list(setting.strikes),
        targets=targets,
        coordinates=best.z,
        young=factor * moduli,
        model=simulation.model.with_young(factor * simulation.coarsening.moduli(moduli)),
        eigenvalues=factor * found.modes.values,
        modes=simulation.mesh_rows(found.modes.vectors),
        surface_vertices=prepared.vertices,
        surface_faces=prepared.faces,
        fine_grid=setting.mesh.grid,
        fine_origin=setting.mesh.origin,
        fine_edge=setting.mesh.edge,
        history=rows,
        settings=prepared.project.as_dict(),
        evidence=evidence,
    )


def history_rows(history: Sequence[Moment]) -> NDArray[np.void]:
    """Moments as rows of a design's history."""
    return np.array(
        [
            (
                moment.seconds,
                moment.evaluations,
                moment.cost.total,
                moment.cost.frequency,
                moment.cost.amplitude,
                moment.cost.regulariser,
            )
            for moment in history
        ],
        HISTORY_TYPE,
    )


@contextmanager
def _interruptible() -> Iterator[Callable[[], bool]]:
    """Whether somebody asked to stop (Ctrl-C or SIGTERM), once; a second time ends the program."""
    asked = False

    def ask(number: int, frame: FrameType | None) -> None:
        nonlocal asked
        asked = True
        _restore(former)

    former: dict[int, Any] = {}
    for each in (signal.SIGINT, signal.SIGTERM):
        try:
            former[each] = signal.signal(each, ask)
        except ValueError:  # not in the main thread, where nobody can ask this way
            break
    try:
        yield lambda: asked
    finally:
        _restore(former)


def _restore(handlers: dict[int, Any]) -> None:
    for number, handler in handlers.items():
        signal.signal(number, handler)
