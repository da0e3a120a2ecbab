"""How long an evaluation takes, and how the optimisers compare on one project."""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from statistics import median
from typing import Any

import numpy as np

from carillon.processes.threads import one_thread
from sound.clips.targets import Targets
from sound.design.objective import fall
from sound.design.optimise import optimise
from sound.design.optimisers import OPTIMISERS
from sound.design.pitch import rms_off_partials
from sound.design.preparation import DesignProblem, prepare
from sound.design.simulation import Evaluation
from sound.project.design import Design
from sound.project.project import Project

CHANGE = 0.05
"""Root mean square change of Phi z between the materials of a warm start."""


def time_evaluations(problem: DesignProblem, runs: int = 7, seed: int = 0) -> dict[str, Any]:
    """Median processor times [s] of evaluations near the uniform material, on one thread.

    `cold_seconds` are from nothing, `warm_seconds` from the modes of a material that differs by
    `CHANGE`, `gradient_seconds` the same with derivatives of all frequencies and amplitudes.
    `analysis_seconds` are the wall time of the warm modal analysis; the rest is coarsening. `runs`
    were measured after one that warms up; `n_dofs`, `modes`, `coordinates` are sizes.
    """
    with one_thread():
        simulation = problem.setting.simulation()
        size = simulation.material.dimensions
        random = np.random.default_rng(seed)
        moves = random.standard_normal((runs + 1, size))
        moves *= CHANGE / np.linalg.norm(moves, axis=1, keepdims=True)
        here = simulation.evaluate(np.zeros(size))
        cold, _ = _timed(lambda k: simulation.evaluate(moves[k]), runs)
        warm, analysis = _timed(lambda k: simulation.evaluate(moves[k], here.modes), runs)
        gradient, _ = _timed(lambda k: simulation.evaluate(moves[k], here.modes, True), runs)
    return {
        "cold_seconds": median(cold),
        "warm_seconds": median(warm),
        "gradient_seconds": median(gradient),
        "analysis_seconds": median(analysis),
        "runs": runs,
        "n_dofs": simulation.model.n_dofs,
        "modes": simulation.modes,
        "coordinates": size,
    }


def compare_optimisers(
    problem: DesignProblem,
    seeds: int = 1,
    fine_check: bool = False,
    report: Callable[[str], None] = lambda what: None,
) -> list[dict[str, Any]]:
    """One row for each optimiser, all with the project's budget and workers.

    Parameters
    ----------
    seeds
        Searches by each, with as many seeds from the project's on.  Rows hold medians of them, and
        the smallest and largest values under names that end in `_min` and `_max`.
    fine_check
        Whether the searches check on the fine solid, whose costs are told then.
    """
    rows = []
    project = problem.project
    for method in OPTIMISERS:
        outcomes = []
        for number in range(seeds):
            seed = project.optimiser.seed + number
            report(method if seeds == 1 else f"{method}, seed {seed}")
            chosen = replace(project.optimiser, method=method, seed=seed, fine_check=fine_check)
            own = replace(problem, project=replace(project, optimiser=chosen))
            outcomes.append(_outcome(optimise(own)))
        rows.append({"method": method, "seeds": seeds, **_medians(outcomes)})
    return rows


def time_sizes(
    project: Project,
    resolutions: Sequence[int],
    runs: int,
    report: Callable[[str], None] = lambda what: None,
) -> list[dict[str, Any]]:
    """Times of evaluations of the project's solid at several resolutions, one row for each."""
    targets: Targets | None = None
    rows = []
    for resolution in resolutions:
        report(f"evaluations at resolution {resolution}")
        problem = prepare(replace(project, resolution=resolution), targets)
        targets = problem.setting.objective.targets
        times = time_evaluations(problem, runs, project.optimiser.seed)
        rows.append({"resolution": resolution, **times})
    return rows


def benchmark(
    problem: DesignProblem,
    runs: int,
    seeds: int = 1,
    fine_check: bool = False,
    report: Callable[[str], None] = lambda what: None,
) -> dict[str, Any]:
    """Times of evaluations, and the optimisers' rows, see `compare_optimisers`."""
    report("evaluations")
    times = time_evaluations(problem, runs, problem.project.optimiser.seed)
    rows = compare_optimisers(problem, seeds, fine_check, report)
    return {"evaluation": times, "rows": rows}


def _outcome(design: Design) -> dict[str, Any]:
    """What one search came to; its curve is that of the checks, where there are any."""
    evidence, history = design.evidence, design.history
    start, end = evidence["cost_start"], evidence["cost"]
    seconds, costs = history["seconds"], history["cost"]
    if evidence["checks"]:
        seconds = np.array([check["seconds"] for check in evidence["checks"]])
        costs = np.minimum.accumulate([check["cost"] for check in evidence["checks"]])
    low = np.flatnonzero(costs <= 0.1 * start)
    targets = design.targets
    return {
        "cost_start": start,
        "cost_end": end,
        "fall_percent": 100.0 * fall(start, end),
        "seconds_to_90_percent": float(seconds[low[0]]) if len(low) else None,
        "evaluations": evidence["evaluations"],
        "evaluations_per_minute": evidence["evaluations_per_minute"],
        "seconds": evidence["seconds"],
        "fine_rms_cents": None
        if design.fine is None
        else rms_off_partials(design.frequencies, targets),
        "workers": evidence["workers"],
        "curve": [[float(s), float(c)] for s, c in zip(seconds, costs, strict=True)],
    }


def _medians(outcomes: list[dict[str, Any]]) -> dict[str, Any]:
    """Medians, smallest and largest values of outcomes, and the curve of the one in the middle.

    What some did not come to is larger than all.
    """
    middle = sorted(outcomes, key=lambda each: each["cost_end"])[(len(outcomes) - 1) // 2]
    row = {"workers": middle["workers"], "curve": middle["curve"]}
    for name in middle.keys() - row.keys():
        values = [np.inf if each[name] is None else each[name] for each in outcomes]
        spread = {name: median(values), f"{name}_min": min(values), f"{name}_max": max(values)}
        row |= {key: value if np.isfinite(value) else None for key, value in spread.items()}
    return row


def _timed(work: Callable[[int], Evaluation], runs: int) -> tuple[list[float], list[float]]:
    """Processor times of `runs` runs after one that warms up, and wall times of their analyses."""
    seconds, analyses = [], []
    for run in range(runs + 1):
        begin = time.process_time()
        evaluation = work(run)
        seconds.append(time.process_time() - begin)
        analyses.append(sum(evaluation.modes.seconds.values()))
        del evaluation  # whose memory the next one takes over
    return seconds[1:], analyses[1:]
