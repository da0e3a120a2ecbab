"""What a search came to: the better one of its best and its first material, analysed to the end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.errors import ConvergenceError, UserError
from carillon.threads import one_thread
from solver.files.modes_file import frequencies
from sound.design.descent import cost_of
from sound.design.objective import Cost
from sound.design.pool import Trial
from sound.design.preparation import Prepared
from sound.design.search import Moment, Search
from sound.design.simulation import Evaluation, Simulation
from sound.project.design_file import HISTORY_TYPE, Design

FINAL_TOLERANCE = 1e-8
"""Relative error of the eigenvalues that a design is written with."""


@dataclass(frozen=True)
class _Analysed:
    """A trial's material, analysed to `FINAL_TOLERANCE`, and its cost."""

    found: Evaluation
    cost: Cost


class Outcome:
    """What searches come to: the better one of their best and their first material.

    Analyses of a search are coarse: what is a little better by them may be a little worse.
    """

    def __init__(self, prepared: Prepared, former_rows: NDArray[np.void]) -> None:
        self._prepared = prepared
        self._former_rows = former_rows
        self._start: _Analysed | None = None

    @cached_property
    def _simulation(self) -> Simulation:
        return self._prepared.setting.simulation(FINAL_TOLERANCE)

    def of(self, search: Search) -> Design:
        """The design that a search has found so far.

        Raises
        ------
        UserError
            If the material to start from has no modes.
        """
        first, best = require_modes(search), search.best
        start = self._start = self._start or self._analysed(first)
        chosen = start
        if best is not None and best is not first:
            try:
                chosen = min(self._analysed(best), start, key=lambda each: each.cost.total)
            except ConvergenceError:  # modes to be had coarsely alone
                pass
        return self._design(search, chosen, start.cost)

    def _analysed(self, trial: Trial) -> _Analysed:
        setting = self._prepared.setting
        # As in the search: sums shared among threads round differently.
        with one_thread():
            found = self._simulation.evaluate(trial.z, trial.start)
            return _Analysed(found, cost_of(setting.objective, setting.material, found))

    def _design(self, search: Search, chosen: _Analysed, cost_start: Cost) -> Design:
        prepared, setting, simulation = self._prepared, self._prepared.setting, self._simulation
        found, cost, targets = chosen.found, chosen.cost, setting.objective.targets
        factor = float((targets.frequencies[0] / frequencies(found.eigenvalues)[0]) ** 2)
        moduli = setting.material.moduli(found.z)
        seconds, evaluations = search.own_seconds, search.own_evaluations
        evidence: dict[str, Any] = {
            "method": prepared.project.optimiser.method,
            "workers": prepared.workers,
            "cost_start": cost_start.total,
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
            coordinates=found.z,
            young=factor * moduli,
            model=replace(simulation.model, young=factor * simulation.elements.moduli(moduli)),
            eigenvalues=factor * found.modes.values,
            modes=simulation.mesh_rows(found.modes.vectors),
            surface_vertices=prepared.vertices,
            surface_faces=prepared.faces,
            fine_grid=setting.mesh.grid,
            fine_origin=setting.mesh.origin,
            fine_edge=setting.mesh.edge,
            history=np.concatenate([self._former_rows, history_rows(search.history)]),
            settings=prepared.project.as_dict(),
            evidence=evidence,
        )


def require_modes(search: Search) -> Trial:
    """The trial that a search began with."""
    if search.start is None or not np.isfinite(search.start.cost.total):
        raise UserError(
            "the material to start from has no modes that could be computed; expected a solid "
            "whose parts hang together, raise resolution"
        )
    return search.start


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
