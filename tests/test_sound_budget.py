"""The budget of a search: as many modal analyses as were asked for, and never for the worse."""

import time
from dataclasses import replace
from itertools import count

import numpy as np
import pytest

from carillon.errors import ConvergenceError
from sound.design import pool
from sound.design.descent import DescentLimits, cost_of
from sound.design.local_search import StepOptions
from sound.design.optimise import optimise
from sound.design.optimisers import OPTIMISERS
from sound.design.pool import Pool
from sound.design.preparation import prepare
from sound.design.simulation import Simulation
from sound.design.tasks import Task
from studies.design.measure import _medians, compare_optimisers
from tests import small_project
from tests.counted_analyses import counted
from tests.small_project import with_options

METHODS = sorted(OPTIMISERS)
TINY = [1, 2, 3, 8]


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    """The targets are sounds of the fine bar, the search works with a coarse one."""
    made = small_project.project(tmp_path_factory.mktemp("project"))
    targets = small_project.targets(made)
    return prepare(replace(made, coarsen="average"), targets)


@pytest.fixture(scope="module")
def of_other_targets(problem):
    """A design to go on from that sounds like something else."""
    targets = small_project.targets(replace(problem.project, coarsen="none"), seed=5)
    return optimise(with_options(prepare(problem.project, targets), evaluations=40))


@pytest.mark.parametrize("fine_check", [False, True])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("most", [*TINY, 50])
def test_analyses_are_those_that_were_asked_for(problem, tmp_path, method, most, fine_check):
    """The result tells as many as were made, which is no more than the budget, and all but one."""
    options = {"method": method, "evaluations": most, "fine_check": fine_check}
    design = optimise(counted(with_options(problem, **options), tmp_path / "count"))
    made = (tmp_path / "count").stat().st_size
    assert made == design.evidence["evaluations"] == design.history["evaluations"][-1]
    assert most - 1 <= made <= most
    assert design.evidence["cost"] <= design.evidence["cost_start"]
    assert design.evidence["ended_by"] == "budget"


@pytest.mark.parametrize("fine_check", [False, True])
def test_analyses_of_two_workers_are_those_of_one(problem, tmp_path, fine_check):
    options = {"evaluations": 50, "fine_check": fine_check, "workers": 2}
    two = optimise(counted(with_options(problem, **options), tmp_path / "count"))
    made = (tmp_path / "count").stat().st_size
    one = optimise(with_options(problem, **{**options, "workers": 1}))
    assert made == two.evidence["evaluations"] == one.evidence["evaluations"]
    assert 49 <= made <= 50


def test_descents_on_the_fine_solid_count(problem, tmp_path, monkeypatch):
    """They are reached where no leg on the coarse one is worthwhile."""
    monkeypatch.setattr("sound.design.space_mapping.WORTHWHILE", 0.0)
    fine = []
    descend = pool.descend_by_model
    monkeypatch.setattr(pool, "descend_by_model", lambda *all: fine.append(1) or descend(*all))
    design = optimise(counted(with_options(problem, evaluations=50), tmp_path / "count"))
    assert fine
    assert (tmp_path / "count").stat().st_size == design.evidence["evaluations"] <= 50


@pytest.mark.parametrize("descends", [False, True])
@pytest.mark.parametrize("most", [1, 2, 5])
def test_an_analysis_that_found_no_modes_counts(problem, monkeypatch, descends, most):
    """And where the start is to blame another one follows, if there is one left."""
    processes = Pool(problem.setting, 1)
    start = pool._simulation.evaluate(np.zeros(10)).modes.start()
    evaluate = pool._simulation.elements.solve
    made = []

    def fails_from_there(solver, young, start, *rest):
        made.append(start)
        if start is not None and len(made) == 1:
            raise ConvergenceError("no modes")
        return evaluate(solver, young, start, *rest)

    monkeypatch.setattr(pool._simulation.elements, "solve", fails_from_there)
    options = StepOptions(((True, True),), 1e-2, 0.5) if descends else None
    limits = DescentLimits(evaluations=most)
    (trial,) = processes.run([Task(np.zeros(10), start, options=options, steps=9, limits=limits)])
    processes.close()
    assert trial.evaluations == len(made) == (most if descends else min(most, 2))
    assert np.isfinite(trial.cost.total) == (most > 1)


@pytest.mark.parametrize("fine_check", [False, True])
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("most", TINY)
def test_going_on_from_another_sound_is_never_for_the_worse(
    problem, of_other_targets, method, most, fine_check
):
    """By the cost of the solid that the design is written for, solved anew."""
    options = {"method": method, "evaluations": most, "fine_check": fine_check}
    chosen = with_options(problem, **options)
    design = optimise(chosen, of_other_targets)
    setting = chosen.setting.fine() if fine_check else chosen.setting
    before, after = (
        cost_on(setting, coordinates)
        for coordinates in (of_other_targets.coordinates, design.coordinates)
    )
    assert design.evidence["cost_start"] == pytest.approx(before, rel=1e-3)
    assert design.evidence["cost"] == pytest.approx(after, rel=1e-3)
    assert design.evidence["cost"] <= design.evidence["cost_start"]


def cost_on(setting, coordinates):
    evaluation = setting.simulation(1e-9).evaluate(coordinates)
    return cost_of(setting.objective, setting.material, evaluation).total


@pytest.mark.parametrize("fine_check", [False, True])
def test_optimisers_are_compared_by_medians_over_seeds(problem, fine_check):
    rows = compare_optimisers(with_options(problem, evaluations=30), 3, fine_check)
    assert [row["method"] for row in rows] == list(OPTIMISERS)
    for row in rows:
        assert row["seeds"] == 3 and 29 <= row["evaluations"] <= 30
        assert row["cost_end_min"] <= row["cost_end"] <= row["cost_end_max"] <= row["cost_start"]
        assert row["fall_percent"] == pytest.approx(100 * (1 - row["cost_end"] / row["cost_start"]))
        assert row["cost_end"] == pytest.approx(row["curve"][-1][1], rel=0.02)
        assert (row["fine_rms_cents"] is None) == (not fine_check)
    by_name = {row["method"]: row for row in rows}
    assert by_name["cma"]["cost_end_min"] < by_name["cma"]["cost_end_max"]
    if not fine_check:  # which L-BFGS has no chance in
        assert by_name["bfgs"]["cost_end_min"] == by_name["bfgs"]["cost_end_max"]


def test_what_some_searches_did_not_come_to_is_larger_than_all():
    found = [
        {"cost_end": cost, "seconds_to_90_percent": after, "curve": [[0.0, cost]], "workers": 1}
        for cost, after in ((1.0, 2.0), (3.0, None), (2.0, 5.0))
    ]
    row = _medians(found)
    assert (row["cost_end"], row["cost_end_min"], row["cost_end_max"]) == (2.0, 1.0, 3.0)
    assert (row["seconds_to_90_percent"], row["seconds_to_90_percent_max"]) == (5.0, None)
    assert row["curve"] == [[0.0, 2.0]]


@pytest.mark.parametrize("fine_check", [False, True])
def test_the_time_of_a_search_is_processor_time(problem, monkeypatch, fine_check):
    """By a clock of the processor that an analysis moves on by a second, those of checks too."""
    made = []
    evaluate = Simulation.evaluate
    monkeypatch.setattr(Simulation, "evaluate", lambda *all: made.append(1) or evaluate(*all))
    monkeypatch.setattr(time, "thread_time", lambda: float(len(made)))
    monkeypatch.setattr(time, "monotonic", lambda: 1e9 * next(ticks))
    ticks = count()
    options = {"seconds": 20.0, "evaluations": None, "workers": 1, "fine_check": fine_check}
    design = optimise(with_options(problem, **options))
    assert 15 <= len(made) <= 25
    assert 15.0 <= design.history["seconds"][-1] <= design.evidence["seconds"]


def test_processes_side_by_side_take_the_time_of_the_slowest(problem):
    processes = Pool(problem.setting, 2)
    z = np.zeros(problem.setting.material.dimensions)
    before = processes.seconds
    trials = processes.run([Task(z)] * 3)
    slowest = max(trial.seconds for trial in trials)
    assert all(trial.seconds > 0.0 for trial in trials)
    assert slowest <= processes.seconds - before < slowest + 1.0
    processes.close()
