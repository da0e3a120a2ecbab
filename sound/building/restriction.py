"""A design restricted to real materials: rounding of its field, then search from there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from carillon.arrays import Array, Index
from carillon.errors import ConvergenceError, UserError
from carillon.processes.threads import one_thread
from solver.files.modes_file import frequencies
from solver.response.dissipation import is_known
from sound.building.flips import FlipLimits, improved
from sound.building.grouping import cubes, width_of
from sound.building.rounding import roundings
from sound.building.voxel_solid import VoxelModes, VoxelSolid
from sound.design.interrupts import interruptible
from sound.design.objective import DesignCost, Objective
from sound.design.outcome import FINAL_TOLERANCE, own_damping
from sound.design.pitch import partials_off, stretch_to
from sound.design.place import with_pressures
from sound.design.preparation import DesignProblem
from sound.project.build import BuildSettings
from sound.project.design import Design
from sound.strikes import Strike

UNIFORM = 1e-6
"""Relative spread of moduli below which a field is the one that a search starts from."""


@dataclass(frozen=True)
class BuildProgress:
    """Where a restriction is: analyses made of so many, cost, and that of the rounding."""

    made: int
    most: int
    cost: DesignCost
    rounded: DesignCost


def built(
    problem: DesignProblem,
    design: Design,
    watch: Callable[[BuildProgress], None] | None = None,
) -> Design:
    """The design of a problem with a real material in each of its voxels, as its project asks.

    Its solid is the fine one, of the size at which its pitch is that of the clips if the project's
    `build.size` is free. What the restriction costs is told by `evidence["build"]`. The result
    does not depend on threads; an interrupt ends the search with the best so far.

    Raises UserError if the design's field is that which the search started from, or the solid is
    too thin for what the project asks, and ConvergenceError if no materials have modes.
    """
    settings = problem.project.build
    field = problem.setting.material.moduli(design.coordinates)
    relative = field / problem.setting.material.young
    if np.ptp(relative) <= UNIFORM * relative.max():
        raise UserError(
            "build: the search has found no material yet, all voxels have the modulus that it "
            "started from; search longer"
        )
    with one_thread(), interruptible() as interrupted:
        return _Restriction(problem, design, settings, watch, interrupted).run(field)


def known_width(problem: DesignProblem) -> float | None:
    """Edge [m] of the cubes of voxels that will be of one material, if it is known before a search.

    None where a region is of one material, or the pitch sets the size of the solid. Raises
    UserError if the solid is too thin for what the project asks.
    """
    settings, mesh = problem.project.build, problem.setting.mesh
    if settings.per != "voxel" or _is_free(problem):
        return None
    return mesh.edge * width_of(settings.at_least, mesh.edge, mesh.grid)


def _is_free(problem: DesignProblem) -> bool:
    """Whether the pitch sets the size."""
    return problem.project.build.size == "free" and not problem.setting.objective.absolute


class _Restriction:
    def __init__(
        self,
        problem: DesignProblem,
        design: Design,
        settings: BuildSettings,
        watch: Callable[[BuildProgress], None] | None,
        interrupted: Callable[[], bool],
    ) -> None:
        self._problem, self._design, self._settings = problem, design, settings
        self._watch, self._interrupted = watch, interrupted
        self._choices = settings.choices()
        setting = problem.setting
        self._is_free = _is_free(problem)
        objective = setting.objective
        if not self._is_free and not objective.absolute:
            objective = Objective(
                objective.targets, objective.weights, absolute=True, heard=objective.heard
            )
        self._objective = objective
        self._solid = VoxelSolid(setting, self._choices.table, objective)

    def run(self, field: Array) -> Design:
        """Round, search, and analyse what is found precisely."""
        width, is_wide = 1, self._settings.per == "voxel" and self._settings.at_least is not None
        rounded = self._rounded(field, self._groups(1))
        if is_wide and self._width(rounded) > 1:
            width = self._width(rounded)
            rounded = self._rounded(field, self._groups(width))
        best = self._improved(rounded, self._groups(width))
        # The pitch sets the size, the size the width in voxels, and that the pitch.
        while is_wide and self._width(best) > width:
            width = self._width(best)
            rounded = self._rounded(field, self._groups(width))
            best = self._improved(rounded, self._groups(width))
        made = self._solid.evaluations
        final = self._solid.evaluate(best.numbers, best.start, FINAL_TOLERANCE)
        return self._built_design(final, rounded, width, made)

    def _width(self, found: VoxelModes) -> int:
        """Voxels that are as wide as asked for, in the size of what is found."""
        mesh = self._problem.setting.mesh
        return width_of(self._settings.at_least, mesh.edge * self._size(found), mesh.grid)

    @property
    def _left(self) -> int:
        return self._settings.evaluations - self._solid.evaluations

    def _groups(self, width: int) -> Index:
        if self._settings.per == "voxel":
            return cubes(self._problem.setting.mesh.grid, width)
        placed = self._problem.setting.placed
        region = None if placed is None else placed.region
        if placed is None or region is None:
            raise UserError("build.per: found region, but the solid is of one; take per: voxel")
        # Directions of a grain are rows of one region.
        names = np.array(placed.regions.names)[region]
        return np.asarray(np.unique(names, return_inverse=True)[1].ravel(), dtype=np.int64)

    def _rounded(self, field: Array, groups: Index) -> VoxelModes:
        """The best of the roundings by its cost."""
        best: VoxelModes | None = None
        error: ConvergenceError | None = None
        for numbers in roundings(field, groups, self._choices.table.young):
            try:
                tried = self._solid.evaluate(numbers)
            except ConvergenceError as failed:
                error = failed
                continue
            if best is None or tried.cost.total < best.cost.total:
                best = tried
            self._tell(best, best)
            if self._interrupted() or self._left <= 0:
                break
        if best is None:
            assert error is not None
            raise error
        return best

    def _improved(self, rounded: VoxelModes, groups: Index) -> VoxelModes:
        def look(now: VoxelModes) -> bool:
            self._tell(now, rounded)
            return self._interrupted()

        return improved(self._solid, rounded, groups, FlipLimits(self._left, look))

    def _tell(self, now: VoxelModes, rounded: VoxelModes) -> None:
        if self._watch is not None:
            made, most = self._solid.evaluations, self._settings.evaluations
            self._watch(BuildProgress(made, most, now.cost, rounded.cost))

    def _size(self, found: VoxelModes) -> float:
        """Factor of all lengths that brings the pitch to that of the clips."""
        if not self._is_free:
            return 1.0
        return 1.0 / stretch_to(frequencies(found.values), self._objective.targets)

    def _built_design(
        self, found: VoxelModes, rounded: VoxelModes, width: int, made: int
    ) -> Design:
        design, solid, size = self._design, self._solid, self._size(found)
        model = solid.model(found.numbers)
        mesh = replace(model.mesh, origin=size * model.mesh.origin, edge=size * model.mesh.edge)
        supports = model.supports
        if supports is not None:
            supports = replace(
                supports,
                positions=size * supports.positions,
                stiffness=size * supports.stiffness,
            )
        model = replace(model, mesh=mesh, supports=supports)
        kept = found.modes.rigid + len(found.values)
        values = found.modes.values[:kept] / size**2
        modes = np.concatenate([found.rigid, found.elastic], axis=1) / size**1.5
        hertz = frequencies(values[found.modes.rigid :])
        damping = design.damping
        if is_known(model):
            count = np.arange(len(hertz))
            elastic = modes[:, found.modes.rigid :]
            damping = own_damping(model, values[found.modes.rigid :], elastic, count, hertz)
        unit = size * float(design.settings.get("unit", 1.0))
        design = replace(
            design,
            strikes=[_larger(strike, size) for strike in design.strikes],
            young=self._choices.table.moduli(found.numbers),
            model=model,
            eigenvalues=values,
            modes=modes,
            surface_vertices=size * design.surface_vertices,
            fine_origin=mesh.origin,
            fine_edge=mesh.edge,
            settings={**design.settings, "unit": unit},
            evidence={**design.evidence, **self._evidence(found, rounded, width, made)},
            fine=None,
            damping=damping,
            fine_region=found.numbers,
        )
        return with_pressures(design, self._objective.heard)

    def _evidence(
        self, found: VoxelModes, rounded: VoxelModes, width: int, made: int
    ) -> dict[str, Any]:
        choices, mesh, size = self._choices, self._problem.setting.mesh, self._size(found)
        volume = (size * mesh.edge) ** 3
        counts = np.bincount(found.numbers, minlength=len(choices))
        at_least = size * mesh.edge * width if self._settings.per == "voxel" else None
        return {
            "residual_max": found.modes.evidence["residual_max"],
            "build": {
                "per": self._settings.per,
                "evaluations": made,
                "size": size,
                "at_least_m": at_least,
                "voxels": width,
                "cost_rounded": rounded.cost.total,
                "cost": found.cost.total,
                "rounded": self._off(rounded),
                "after": self._off(found),
                "materials": [
                    {
                        "name": name,
                        "young_pa": float(choices.table.young[row]),
                        "density_kg_per_m3": float(choices.table.density[row]),
                        "poisson": choices.table.laws[row].poisson,
                        "fraction": float(choices.fractions[row]),
                        "colour": choices.colours[row].tolist(),
                        "volume_m3": float(counts[row] * volume),
                    }
                    for row, name in enumerate(choices.table.names)
                ],
            },
        }

    def _off(self, found: VoxelModes) -> dict[str, float]:
        return partials_off(frequencies(found.values) / self._size(found), self._objective.targets)


def _larger(strike: Strike, size: float) -> Strike:
    return replace(strike, position=size * strike.position, distance=size * strike.distance)
