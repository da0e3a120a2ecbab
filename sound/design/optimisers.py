"""Optimisers of the material: a hybrid after appendix 3, and its two parts on their own."""

from dataclasses import replace
from typing import Any

import numpy as np

from carillon.arrays import Array
from sound.design.local_search import LimitedMemory, StepOptions
from sound.design.reduced_model import TrustRegion
from sound.design.search import Search
from sound.design.tasks import Task, Trial

ALTERNATING = ((True, False), (False, True), (True, True))
"""Terms that successive steps reduce: E_f, then E_a (section 6), then both, as each of the two
undoes some of the other's gain."""
TOGETHER = ((True, True),)
DESCENTS = (
    StepOptions(ALTERNATING, damping=1e-2, longest=0.5),
    StepOptions(TOGETHER, damping=1e-2, longest=0.5),
    StepOptions(ALTERNATING, damping=10.0, longest=0.1),
    LimitedMemory(evaluations=2),
)
"""Descents that run side by side, as none is the best for all solids."""
FINE_DESCENTS = (TrustRegion(radius=0.3), TrustRegion(radius=0.03))
"""Descents that run side by side on the fine solid."""
FINE_STEPS = 3
"""Number of steps of a descent on the fine solid before all are compared."""
STEPS = 6
"""Number of steps of a descent on the coarse solid before all are compared."""
WORTHWHILE = 0.01
"""Least relative decrease of the cost in these steps of a descent that goes on."""
SPREAD = 0.03
"""Standard deviation of the first offspring along each coordinate."""
_LARGE = 1e12
"""Cost that stands for infinity."""


def hybrid(search: Search, z: Array, seed: int, population: int | None) -> None:
    """Descents to local optima, and evolution to leave them, as in appendix 3 but side by side.

    A descent that stalls is replaced by one from the best offspring of the evolution strategy
    around the best known material.  The ends of descents are injected into the strategy, whose
    covariance learns where better optima lie.
    """
    lanes = [Task(z, options=options, steps=STEPS) for options in DESCENTS]
    strategy: Any = None
    while True:
        trials = search.run(lanes)
        stalled = [k for k, trial in enumerate(trials) if _is_stalled(trial)]
        lanes = [_continued(lane, trial) for lane, trial in zip(lanes, trials)]
        if not stalled:
            continue
        best = search.best
        assert best is not None
        if strategy is None:
            strategy = _strategy(best.z, seed, population)
        strategy.inject([best.z, *(trials[k].z for k in stalled)], force=True)
        points = [np.asarray(point) for point in strategy.ask()]
        offspring = search.run([Task(point, best.start) for point in points])
        strategy.tell(points, [_rank(trial) for trial in offspring])
        new = [trial for trial in sorted(offspring, key=_rank) if not _is_known(trial, trials)]
        for lane, trial in zip(stalled, new):
            lanes[lane] = Task(trial.z, best.start, options=DESCENTS[lane], steps=STEPS)


def evolution(search: Search, z: Array, seed: int, population: int | None) -> None:
    """CMA-ES alone."""
    (first,) = search.run([Task(z, gradient=True)])
    strategy = _strategy(z, seed, population)
    while True:
        points = [np.asarray(point) for point in strategy.ask()]
        trials = search.run([Task(point, first.start) for point in points])
        strategy.tell(points, [_rank(trial) for trial in trials])
        if min(_rank(trial) for trial in trials) < first.cost.total:
            best = search.best
            assert best is not None
            (first,) = search.run([Task(best.z, first.start, gradient=True)])


def quasi_newton(search: Search, z: Array, seed: int, population: int | None) -> None:
    """L-BFGS (scipy) alone, restarted where it stopped as long as there is time."""
    from scipy.optimize import minimize

    start: Array | None = None

    def value(point: Array) -> tuple[float, Array]:
        nonlocal start
        (trial,) = search.run([Task(point, start, gradient=True)])
        if trial.gradient is None:
            return _LARGE, np.zeros(len(point))
        start = trial.start
        return trial.cost.total, trial.gradient

    while True:
        z = minimize(value, z, jac=True, method="L-BFGS-B").x


def descend_finely(search: Search, z: Array) -> None:
    """Descents on the fine solid, until all of them have stalled."""
    lanes = [Task(z, options=options, steps=FINE_STEPS, fine=True) for options in FINE_DESCENTS]
    while True:
        trials = search.run(lanes)
        if all(_is_stalled(trial) for trial in trials):
            return
        lanes = [_continued(lane, trial) for lane, trial in zip(lanes, trials)]


OPTIMISERS = {"hybrid": hybrid, "cma": evolution, "bfgs": quasi_newton}


def _continued(lane: Task, trial: Trial) -> Task:
    damping = None if trial.descent is None else trial.descent.damping
    return replace(lane, z=trial.z, start=trial.start, damping=damping)


def _is_stalled(trial: Trial) -> bool:
    if trial.descent is None or trial.descent.stalled:
        return True
    return trial.cost.total > (1.0 - WORTHWHILE) * trial.descent.costs[0].cost.total


def _is_known(trial: Trial, others: list[Trial]) -> bool:
    return any(np.allclose(trial.z, other.z, rtol=0.0, atol=1e-9) for other in others)


def _rank(trial: Trial) -> float:
    return min(trial.cost.total, _LARGE)


def _strategy(z: Array, seed: int, population: int | None) -> Any:
    import cma

    options = {"seed": seed + 1, "verbose": -9, "verb_log": 0}
    if population is not None:
        options["popsize"] = population
    return cma.CMAEvolutionStrategy(z, SPREAD, options)
