"""Outcome of a search: the better of its best and its first material, analysed precisely.

Loss factors of the material's regions are fitted to the dampings of the clips.  The loss factor of
a material is the share of its strain energy that a radian of vibration loses.  A mode loses the
energy that its regions lose, each by its share s_r of the mode's strain energy (modal strain energy
method; Johnson and Kienholz, AIAA Journal 20, 1982):

    d = alpha / 2 + omega / 2 sum_r eta_r s_r .
"""

from collections.abc import Sequence
from dataclasses import asdict, astuple, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import nnls

from carillon.arrays import Array
from carillon.errors import ConvergenceError
from carillon.fem.geometry import HexMesh
from carillon.fem.model import Solid
from carillon.limits import DENSITIES
from carillon.processes.threads import one_thread
from solver.distribution.partition import partition_cells
from solver.files.modes_file import frequencies
from solver.response.dissipation import dissipation, is_known
from sound.clips.targets import Targets
from sound.design.descent import cost_of
from sound.design.fine_check import FineModes, FineSolid
from sound.design.objective import DesignCost
from sound.design.pitch import stretch_to
from sound.design.place import with_pressures
from sound.design.preparation import DesignProblem
from sound.design.search import HistoryEntry, Search, require_modes
from sound.design.simulation import Evaluation, Simulation
from sound.design.space_mapping import Checked
from sound.design.tasks import Trial
from sound.project.design import HISTORY_TYPE, Design, FineFrequencies, MaterialDamping

FINAL_TOLERANCE = 1e-12
"""Relative error of a design's eigenvalues; its square root is that of the modes and the cost."""
ALIKE = 1e-4
"""Weight of the differences between loss factors.  It is small, and makes equal those that dampings
do not distinguish, such as of the two ends of a bar."""


@dataclass(frozen=True)
class _Analysed:
    """A material's modes to `FINAL_TOLERANCE`, its cost, and its modes on the fine solid."""

    evaluation: Evaluation
    cost: DesignCost
    fine: FineModes | None = None


class Outcome:
    """Outcome of a search.

    Analyses in a search are imprecise, so a slightly better material may really be worse than the
    first one.
    """

    def __init__(self, problem: DesignProblem, former_rows: NDArray[np.void]) -> None:
        self._problem = problem
        self._former_rows = former_rows
        self._start: _Analysed | None = None

    @cached_property
    def _simulation(self) -> Simulation:
        return self._problem.setting.simulation(FINAL_TOLERANCE)

    @cached_property
    def _fine_solid(self) -> FineSolid:
        return FineSolid(self._problem.setting, self._simulation)

    def of(self, search: Search) -> Design:
        """The best design of a search so far, by analyses of the solid of the search.

        Raises UserError if the material to start from has no modes.
        """
        first, best = require_modes(search), search.best
        start = self._start = self._start or self._analysed(first)
        chosen = start
        if best is not None and best is not first:
            try:
                chosen = min(self._analysed(best), start, key=lambda each: each.cost.total)
            except ConvergenceError:  # it has modes at the tolerance of the search only
                pass
        return self._design(search, chosen, start.cost.total)

    def checked(self, trial: Trial) -> Checked:
        """A trial's material, analysed on the solid of the search and on the fine solid.

        Raises ConvergenceError if it has no modes on one of them.
        """
        evaluation = self._analysed(trial).evaluation
        return Checked(evaluation, self._fine_solid.modes(evaluation))

    def of_checked(self, search: Search, best: Checked) -> Design:
        """The design of the best material by checks on the fine solid."""
        chosen = _Analysed(best.evaluation, best.fine.cost, best.fine)
        return self._design(search, chosen, search.checks[0].cost)

    def _analysed(self, trial: Trial) -> _Analysed:
        setting = self._problem.setting
        # One thread as in the search: sums over several threads round differently.
        with one_thread():
            evaluation = self._simulation.evaluate(trial.z, trial.start)
            return _Analysed(evaluation, cost_of(setting.objective, setting.material, evaluation))

    def _design(self, search: Search, chosen: _Analysed, cost_start: float) -> Design:
        problem, setting, simulation = self._problem, self._problem.setting, self._simulation
        evaluation, cost, targets = chosen.evaluation, chosen.cost, setting.objective.targets
        fine = chosen.fine
        hertz = frequencies(evaluation.eigenvalues) if fine is None else fine.frequencies
        # Springs and masses of supports give the solid a scale of its own.
        is_free = not setting.objective.absolute
        stretch = stretch_to(hertz, targets) if is_free else 1.0
        moduli = stretch**2 * setting.material.moduli(evaluation.z)
        regions = simulation.regions(evaluation.z)
        bounds = problem.project.material.young_bounds if is_free else None
        heavier = weight(moduli, regions.density, bounds)
        young = heavier * moduli
        model = simulation.elements.with_young(young).with_regions(regions.scaled(heavier, 1.0))
        if model.supports is not None:
            # What is held is so by springs as stiff as the solid is.
            stiffness = heavier * stretch**2 * model.supports.stiffness
            model = model.with_supports(replace(model.supports, stiffness=stiffness))
        values = stretch**2 * evaluation.modes.values
        modes = simulation.mesh_rows(evaluation.modes.vectors) / np.sqrt(heavier)
        order = np.arange(len(hertz)) if fine is None else fine.order
        # One thread as in the search: sums over several threads round differently.
        with one_thread():
            if is_known(model):
                rigid = evaluation.modes.rigid
                damping = own_damping(
                    model, values[rigid:], modes[:, rigid:], order, stretch * hertz
                )
            else:
                damping = material_damping(
                    simulation,
                    evaluation,
                    setting.mesh,
                    problem.project.damping.regions,
                    stretch * hertz,
                    order,
                    targets,
                )
        seconds, evaluations = search.own_seconds, search.own_evaluations
        evidence: dict[str, Any] = {
            "method": problem.project.optimiser.method,
            "workers": problem.workers,
            "cost_start": cost_start,
            "cost": cost.total,
            "frequency_cost": cost.frequency,
            "amplitude_cost": cost.amplitude,
            "seconds": seconds,
            "evaluations": evaluations,
            "evaluations_per_minute": 60.0 * evaluations / seconds,
            "ended_by": search.ending,
            "scale_of_moduli": heavier * stretch**2,
            "residual_max": evaluation.modes.evidence["residual_max"],
            "orthogonality": evaluation.modes.evidence["orthogonality"],
            "eigenvalue_error_estimate": evaluation.modes.evidence["eigenvalue_error_estimate"],
            "n_dofs": simulation.model.n_dofs,
            "checks": [asdict(entry) for entry in search.checks],
        }
        design = Design(
            strikes=list(setting.strikes),
            targets=targets,
            coordinates=evaluation.z,
            young=young,
            model=model,
            eigenvalues=values,
            modes=modes,
            surface_vertices=problem.vertices,
            surface_faces=problem.faces,
            fine_grid=setting.mesh.grid,
            fine_origin=setting.mesh.origin,
            fine_edge=setting.mesh.edge,
            history=np.concatenate([self._former_rows, history_rows(search.history)]),
            settings=problem.project.as_dict(),
            evidence=evidence,
            fine=None if fine is None else FineFrequencies(stretch * hertz, fine.order),
            damping=damping,
            fine_region=None if setting.placed is None else setting.placed.region,
        )
        return with_pressures(design, setting.objective.heard)


def history_rows(history: Sequence[HistoryEntry]) -> NDArray[np.void]:
    """Rows of a design's history."""
    rows = [(each.seconds, each.evaluations, *astuple(each.cost)) for each in history]
    return np.array(rows, HISTORY_TYPE)


def weight(moduli: Array, density: ArrayLike, bounds: Sequence[float] | None) -> float:
    """Factor of moduli (M,) [Pa] and densities [kg/m^3], nearest to 1, for moduli within bounds
    (2,) [Pa].

    Frequencies depend on moduli over density, so a factor common to both is free; the loudness of a
    design is that of its clips, whatever the density.  If the moduli span more than the bounds do,
    the geometric mean of their extremes becomes that of the bounds.  The density stays within
    `carillon.limits.DENSITIES`.  Without bounds it is 1.

    Examples
    --------
    >>> weight(np.array([1e12, 4e13]), 1000.0, (1e9, 4e11))
    0.01
    >>> weight(np.array([2e9, 4e10]), 1000.0, (1e9, 4e11))
    1.0
    """
    if bounds is None:
        return 1.0
    least, most = bounds[0] / moduli.min(), bounds[1] / moduli.max()
    factor = np.clip(1.0, least, most) if least <= most else np.sqrt(least * most)
    low, high = DENSITIES[0] / np.min(density), DENSITIES[1] / np.max(density)
    return float(np.clip(factor, low, high))


def own_damping(
    model: Solid,
    eigenvalues: Array,
    elastic: Array,
    order: NDArray[np.integer],
    hertz: Array,
) -> MaterialDamping:
    """Dampings of modes by those of the regions, which are known.

    The elastic modes (n_dofs, N) with numbers `order` (N,) have the frequencies `hertz` (N,) [Hz].
    """
    lost = dissipation(model, eigenvalues, elastic)
    square = np.empty_like(eigenvalues)
    square[order] = (2.0 * np.pi * hertz) ** 2
    return MaterialDamping(None, 0.0, lost.decay_per_second(square)[order])


def material_damping(
    simulation: Simulation,
    evaluation: Evaluation,
    mesh: HexMesh,
    regions: int,
    hertz: Array,
    order: NDArray[np.integer],
    targets: Targets,
) -> MaterialDamping:
    """Loss factors that bring the dampings of a material's partials near to those of the targets.

    There are so many regions of the voxels with a loss factor each; they depend on the solid alone.
    The modes have the frequencies `hertz` (N,) [Hz], and the numbers `order` (N,) in the
    evaluation.
    """
    labels = partition_cells(mesh, min(regions, mesh.n_cells))
    shares = simulation.energy_shares(evaluation, labels)[order]
    which = targets.sounding
    factors, mass = fitted_loss_factors(shares[which], hertz[which], targets.dampings[which])
    dampings = 0.5 * mass + np.pi * hertz * (shares @ factors)
    return MaterialDamping(factors[labels], mass, np.maximum(dampings, 0.0))


def fitted_loss_factors(shares: Array, hertz: Array, targets: Array) -> tuple[Array, float]:
    """Loss factors (R,) and alpha [1/s], none negative, for dampings nearest to targets (N,) [1/s].

    `shares` (N, R) are those of the regions in the modes' strain energies, `hertz` (N,)
    frequencies. Least squares of relative differences, so that large dampings do not outweigh small
    ones.

    Examples
    --------
    >>> shares, hertz = np.array([[0.9, 0.1], [0.2, 0.8], [0.5, 0.5]]), np.array([1e2, 2e2, 3e2])
    >>> targets = np.pi * hertz * (shares @ np.array([0.01, 0.03]))
    >>> factors, mass = fitted_loss_factors(shares, hertz, targets)
    >>> factors.round(6).tolist(), round(mass, 6)
    ([0.01, 0.03], 0.0)
    """
    lost = np.pi * hertz[:, None] * shares / targets[:, None]
    regions = shares.shape[1]
    differences = ALIKE * np.linalg.norm(lost) * (np.eye(regions) - 1.0 / regions)
    columns = np.column_stack(
        [np.concatenate([lost, differences]), np.append(0.5 / targets, np.zeros(regions))]
    )
    solution = nnls(columns, np.append(np.ones(len(targets)), np.zeros(regions)))[0]
    return solution[:-1], float(solution[-1])
