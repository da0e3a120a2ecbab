"""The search for a material: what it reaches, and what it does not depend on."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import psutil
import pytest
import yaml

from carillon.errors import ConvergenceError, UserError
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.problem import ProblemOptions, build_problem
from sound.design.objective import DesignCost, Objective
from sound.design.optimise import optimise
from sound.design.optimisers import OPTIMISERS
from sound.design.outcome import Outcome, weight
from sound.design.pool import Pool
from sound.design.preparation import coordinates_of, prepare, targets_of
from sound.design.search import HistoryEntry
from sound.design.tasks import Task, Trial
from sound.project.design import HISTORY_TYPE
from sound.project.design_file import read_design, write_design
from sound.project.project import project_of
from sound.project.settings import Weights
from sound.rendering.listening import Listening
from sound.rendering.solid import SoundingSolid
from tests import small_project
from tests.patience import HANG_SECONDS, words_of
from tests.small_project import with_options


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    made = small_project.project(tmp_path_factory.mktemp("project"))
    return prepare(made, small_project.targets(made))


@pytest.fixture(scope="module")
def designed(problem):
    return optimise(problem)


def with_targets(problem, targets):
    names = set(targets.names)
    strikes = [strike for strike in problem.setting.strikes if strike.name in names]
    objective = Objective(targets, problem.project.weights)
    return replace(problem, setting=replace(problem.setting, strikes=strikes, objective=objective))


def test_hybrid_finds_a_material_that_sounds_alike(designed):
    assert designed.evidence["cost"] < 0.02 * designed.evidence["cost_start"]
    targets = designed.targets
    distances = np.log(designed.frequencies / targets.frequencies)
    assert abs(distances.mean()) < 1e-9  # the common factor that comes nearest to all
    np.testing.assert_allclose(designed.frequencies, targets.frequencies, rtol=0.03)
    assert (np.diff(designed.history["cost"]) <= 0.0).all()
    assert (np.diff(designed.history["evaluations"]) >= 0).all()
    assert designed.evidence["residual_max"] < 1e-3
    assert designed.young.min() > 0.0


def test_a_design_of_finite_cells(tmp_path):
    """Modes and their derivatives of the solid as it is lead to a material as well."""
    made = small_project.project(tmp_path, evaluations=60)
    made = replace(made, resolution=12, discretisation="finite-cell")
    designed = optimise(prepare(made, small_project.targets(made)))
    assert designed.evidence["cost"] < 0.1 * designed.evidence["cost_start"]
    test_written_modes_are_those_of_the_written_model(designed, tmp_path)


def test_written_modes_are_those_of_the_written_model(designed, tmp_path):
    """An independent solver finds the same frequencies from what the file says."""
    from solver import solve

    write_design(tmp_path / "design.h5", designed)
    read = read_design(tmp_path / "design.h5")
    truth = solve(read.model, modes=6 + len(read.frequencies), method="slepc")
    np.testing.assert_allclose(truth.frequencies[6:], read.coarse_frequencies, rtol=1e-6)


@pytest.mark.parametrize("discretisation", ["voxel", "finite-cell"])
def test_density_gives_way_to_bounds_of_the_moduli(tmp_path, discretisation):
    """Frequencies stay, as do the gains of the struck points times the modes there."""
    made = small_project.project(tmp_path, evaluations=1)
    made = replace(made, discretisation=discretisation)
    targets = small_project.targets(made)
    free = optimise(prepare(made, targets))
    bounds = [1e3 * free.young.max(), 1e6 * free.young.max()]
    made = replace(made, material=replace(made.material, young_bounds=bounds))
    bound = optimise(prepare(made, targets))
    factor = bound.model.density / made.solid.density
    assert bounds[0] * (1.0 - 1e-9) <= bound.young.min()
    np.testing.assert_allclose(bound.young, factor * free.young)
    np.testing.assert_array_equal(bound.frequencies, free.frequencies)
    test_written_modes_are_those_of_the_written_model(bound, tmp_path)
    heard = [Listening.of_design(each, SoundingSolid.of_design(each)) for each in (free, bound)]
    np.testing.assert_allclose(heard[1].gains, np.sqrt(factor) * heard[0].gains)


@pytest.mark.parametrize(
    ("discretisation", "coarsen"), [("voxel", "none"), ("voxel", "ddfem"), ("finite-cell", "none")]
)
def test_poissons_ratio_is_found_and_gone_on_from(tmp_path, discretisation, coarsen):
    """Targets of a bar whose Poisson's ratio is another than that of the start."""
    made = small_project.project(tmp_path, evaluations=90)
    resolution = 16 if discretisation == "voxel" else 12
    made = replace(made, discretisation=discretisation, coarsen=coarsen, resolution=resolution)
    targets = small_project.targets(replace(made, poisson=0.42))
    fixed = optimise(prepare(made, targets))
    free = replace(made, material=replace(made.material, poisson_bounds=[0.0, 0.45]))
    designed = optimise(prepare(free, targets))
    assert designed.evidence["cost"] < fixed.evidence["cost"]
    assert 0.25 < designed.model.poisson < 0.45 and fixed.model.poisson == 0.25
    test_written_modes_are_those_of_the_written_model(designed, tmp_path)
    kept = coordinates_of(prepare(free, targets), designed)
    np.testing.assert_array_equal(kept, designed.coordinates)
    narrow = replace(free, material=replace(free.material, poisson_bounds=[0.2, 0.48]))
    other = prepare(narrow, targets)
    z = coordinates_of(other, designed)
    assert other.setting.simulation().regions(z).poisson == pytest.approx(designed.model.poisson)


def test_free_ratios_that_forests_are_not_for_are_refused_before_the_search(tmp_path):
    made = replace(small_project.project(tmp_path), coarsen="ddfem")
    targets = small_project.targets(made)
    free = replace(made, material=replace(made.material, poisson_bounds=[-0.2, 0.4]))
    with pytest.raises(UserError, match="Poisson's ratios 0 to 0.49, the model has -0.2"):
        prepare(free, targets)


def test_bounds_narrower_than_the_moduli_have_their_middle():
    moduli = np.array([1e8, 1e9, 1e10])
    assert weight(moduli, 1000.0, (1e6, 1e6 + 1.0)) * 1e9 == pytest.approx(1e6)
    assert weight(moduli, 1000.0, None) == 1.0
    assert weight(moduli, 1000.0, (1e15, 2e15)) == 1e3  # what a solid may weigh


@pytest.mark.parametrize("method", sorted(set(OPTIMISERS) - {"hybrid"}))
def test_parts_of_the_hybrid_improve_by_themselves(problem, method):
    design = optimise(with_options(problem, method=method, evaluations=60))
    assert design.evidence["cost"] < 0.7 * design.evidence["cost_start"]


def test_result_does_not_depend_on_the_number_of_workers(problem):
    one, two = (optimise(with_options(problem, evaluations=60, workers=n)) for n in (1, 2))
    np.testing.assert_array_equal(one.coordinates, two.coordinates)
    np.testing.assert_array_equal(one.modes, two.modes)
    assert one.evidence["cost"] == two.evidence["cost"]


def test_a_worse_material_than_that_of_the_start_is_not_saved(problem):
    """Though the coarse analyses of a search may take it for a better one."""
    start = np.zeros(problem.setting.material.dimensions)
    worse = start.copy()
    worse[0] = 1.0
    search = SimpleNamespace(
        start=Trial(start, DesignCost(9.0, 9.0, 0.0, 0.0), 1),
        best=Trial(worse, DesignCost(8.0, 8.0, 0.0, 0.0), 1),
        history=[HistoryEntry(1.0, 2, DesignCost(8.0, 8.0, 0.0, 0.0))],
        own_seconds=1.0,
        own_evaluations=2,
        checks=[],
        ending="budget",
    )
    costs = [
        Outcome(problem, np.empty(0, HISTORY_TYPE)).of(SimpleNamespace(**{**vars(search), **other}))
        for other in ({}, {"best": search.start}, {"start": search.best})
    ]
    assert [each.evidence["cost"] for each in costs[:2]] == [costs[1].evidence["cost_start"]] * 2
    assert costs[2].evidence["cost"] > costs[0].evidence["cost"]
    np.testing.assert_array_equal(costs[0].coordinates, start)


def test_a_start_without_modes_is_refused_at_once(problem, monkeypatch):
    def fail(*_, **__):
        raise ConvergenceError("no modes")

    monkeypatch.setattr(ModalSolver, "solve", fail)
    with pytest.raises(UserError, match="to start from has no modes"):
        optimise(with_options(problem, evaluations=None))


def test_modes_are_found_however_far_away_the_start_is(problem):
    """From the symmetric modes of the uniform bar, those of one material in seven are not."""
    simulation = problem.setting.simulation()
    materials = 0.15 * np.random.default_rng(0).normal(size=(30, simulation.material.dimensions))
    uniform = simulation.evaluate(np.zeros_like(materials[0])).modes
    for z in materials:
        found, expected = simulation.evaluate_anyway(z, uniform), simulation.evaluate(z)
        np.testing.assert_allclose(found.eigenvalues, expected.eigenvalues, rtol=2e-3)


@pytest.mark.parametrize("weights", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
def test_a_part_of_the_cost_may_weigh_nothing(problem, weights):
    objective = Objective(problem.setting.objective.targets, Weights(*weights))
    setting = replace(problem.setting, objective=objective)
    design = optimise(with_options(replace(problem, setting=setting), evaluations=30))
    assert design.evidence["cost"] < design.evidence["cost_start"]


def test_a_design_without_a_history_can_be_gone_on_from(problem, designed):
    bare = replace(designed, history=designed.history[:0])
    again = optimise(with_options(problem, evaluations=1), initial=bare)
    assert again.history["evaluations"].tolist() == [1.0, 1.0]


def test_a_design_goes_on_from_where_it_was(problem, designed):
    again = optimise(with_options(problem, evaluations=30), initial=designed)
    # Analyses of one material from different modes agree to their tolerance, and so do the terms
    # whose squares a cost is the sum of.
    assert np.sqrt(again.evidence["cost"]) <= np.sqrt(designed.evidence["cost"]) + 1e-6
    assert again.history["evaluations"][-1] > designed.history["evaluations"][-1]
    assert (np.diff(again.history["seconds"]) >= 0.0).all()


def test_a_target_can_be_added(problem):
    made = problem.project
    one = with_targets(problem, small_project.targets(made, names=("end",)))
    first = optimise(with_options(one, evaluations=60))
    both = optimise(with_options(problem, evaluations=60), initial=first)
    assert len(first.strikes) == 1 and len(both.strikes) == 2
    alone = optimise(with_options(problem, evaluations=1, method="cma"))
    # The material of the first search is a better start than the uniform one.
    assert both.evidence["cost_start"] < alone.evidence["cost_start"]
    assert both.evidence["cost"] < both.evidence["cost_start"]


def test_design_of_other_voxels_is_refused(problem, designed):
    other = replace(designed, fine_grid=designed.fine_grid[:-1])
    with pytest.raises(UserError, match="begin a new design"):
        optimise(problem, initial=other)


def test_voxels_are_those_that_the_solver_fills(problem):
    # A resolution at which the middle of a voxel lies on the surface.
    project = replace(problem.project, resolution=36)
    made = prepare(project, problem.setting.objective.targets)
    filled = build_problem(ProblemOptions(project.mesh, project.resolution)).fine
    np.testing.assert_array_equal(made.setting.mesh.grid, filled.grid)


def test_designs_are_kept_on_the_way(problem, monkeypatch):
    monkeypatch.setattr("sound.design.optimise.KEEP_SECONDS", 0.0)
    kept = []
    optimise(with_options(problem, evaluations=60), keep=kept.append)
    costs = [each.evidence["cost"] for each in kept]
    assert len(kept) > 1 and costs[-1] < costs[0]


def test_cost_vanishes_at_the_targets_and_knows_no_scale_nor_sign(problem):
    simulation = problem.setting.simulation()
    objective = problem.setting.objective
    z = 0.1 * np.random.default_rng(3).standard_normal(simulation.material.dimensions)
    evaluation = simulation.evaluate(z)
    targets = replace(
        objective.targets,
        frequencies=np.sqrt(evaluation.eigenvalues) / 7.0,
        amplitudes=5.0 * np.abs(evaluation.pushed),
    )
    same = Objective(targets, Weights(1.0, 10.0, 0.0))
    assert same.cost(evaluation.eigenvalues, evaluation.pushed, 0.0).total < 1e-20
    cost = objective.cost(evaluation.eigenvalues, evaluation.pushed, 0.0)
    signs = np.where(np.arange(len(evaluation.eigenvalues)) % 2, 1.0, -1.0)
    other = objective.cost(3.0 * evaluation.eigenvalues, 2.0 * signs * evaluation.pushed, 0.0)
    assert other.total == pytest.approx(cost.total, rel=1e-12)


def test_the_amplitude_of_every_mode_counts(problem):
    targets = problem.setting.objective.targets
    values = targets.frequencies**2
    heard = Objective(targets, Weights(1.0, 10.0, 0.0))
    assert heard.cost(values, targets.amplitudes, 0.0).total < 1e-20
    for mode in range(len(values)):
        pushed = targets.amplitudes.copy()
        pushed[:, mode] *= 0.5
        assert heard.cost(values, pushed, 0.0).amplitude > 1e-4, mode


def test_mixed_modes_of_a_cluster_cost_the_same(problem):
    objective = problem.setting.objective
    random = np.random.default_rng(0)
    values = np.array([1.0, 2.0, 2.0, 3.0, 5.0, 6.0]) * 1e6
    pushed = random.standard_normal((2, 6))
    c, s = np.cos(0.7), np.sin(0.7)
    mixed = pushed.copy()
    mixed[:, 1:3] = pushed[:, 1:3] @ np.array([[c, s], [-s, c]])
    costs = [objective.cost(values, each, 0.0).total for each in (pushed, mixed)]
    assert costs[0] == pytest.approx(costs[1], rel=1e-12)


def test_a_worker_that_dies_is_told(problem):
    processes = Pool(problem.setting, 2)
    z = np.zeros(problem.setting.material.dimensions)
    try:
        processes.run([Task(z)] * 2)
        threading.Timer(0.2, next(iter(processes._pool._processes.values())).kill).start()
        with pytest.raises(UserError, match="died"):
            while True:
                processes.run([Task(z)] * 4)
    finally:
        processes.close()


def run_design(folder, *words, **options):
    command = [sys.executable, "-m", "sound", "design", "project.yaml", "--out", "design.h5"]
    return subprocess.Popen(
        [*command, *words],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": os.getcwd()},
        **options,
    )


@pytest.fixture
def folder(tmp_path):
    small_project.write_clips(tmp_path, np.array([500.0, 1200.0, 1900.0, 2600.0, 3300.0, 4100.0]))
    (tmp_path / "project.yaml").write_text(yaml.safe_dump(small_project.PROJECT))
    return tmp_path


def test_command_from_clips_to_file_and_on(folder):
    first = run_design(folder, "--json", "--seed", "5")
    out, errors = first.communicate()
    assert first.returncode == 0, errors
    summary = json.loads(out)
    assert summary["cost"] < 0.7 * summary["cost_start"] and summary["workers"] == 1
    design = read_design(folder / "design.h5")
    assert design.settings["optimiser"]["seed"] == 5
    before = design.history["evaluations"][-1]
    second = run_design(folder, "--evaluations", "8")
    out, errors = second.communicate()
    assert second.returncode == 0, errors
    assert f"going on after {before:.0f} evaluations" in errors and "less) in" in out
    assert read_design(folder / "design.h5").history["evaluations"][-1] > before


def test_evaluations_are_timed_at_several_resolutions(folder, capsys, monkeypatch):
    from sound.__main__ import main

    monkeypatch.chdir(folder)
    words = ["benchmark", "project.yaml", "--runs", "1", "--resolutions", "8", "16"]
    assert main([*words, "--json"]) == 0
    small, large = json.loads(capsys.readouterr().out)["evaluations"]
    assert (small["resolution"], large["resolution"]) == (8, 16)
    assert small["n_dofs"] < large["n_dofs"]
    assert large["modes"] == 6 and large["gradient_seconds"] > 0.0
    assert main(words) == 0
    assert f"evaluation of {large['n_dofs']:,} unknowns" in capsys.readouterr().out


def test_somebody_who_interrupts_gets_the_best_so_far(problem):
    rounds = []

    def interrupt(search):
        rounds.append(search.own_evaluations)
        if len(rounds) == 2:
            os.kill(os.getpid(), signal.SIGTERM)

    design = optimise(with_options(problem, evaluations=10**6), watch=interrupt)
    assert len(rounds) == 2
    assert design.evidence["cost"] < design.evidence["cost_start"]


def test_more_modes_than_the_clips_have(folder):
    with pytest.raises(UserError, match="40 modes"):
        targets_of(project_of({**small_project.PROJECT, "modes": 40}, folder))


@pytest.mark.nightly
def test_workers_end_with_a_killed_parent(folder):
    process = run_design(folder, "--workers", "2", "--evaluations", "1000000")
    workers = workers_of(process)
    process.kill()
    process.wait()
    assert not psutil.wait_procs(workers, timeout=HANG_SECONDS)[1]


def test_an_interrupt_of_all_processes_ends_a_search_without_a_loss(folder):
    """As Ctrl-C does, and with other signals schedulers."""
    words = ("--workers", "2", "--evaluations", "1000000")
    process = run_design(folder, *words, start_new_session=True)
    workers = workers_of(process)
    os.killpg(process.pid, signal.SIGINT)
    out, errors = process.communicate()
    assert process.returncode == 0, errors
    assert "asked to stop: the best so far is written" in errors and "less) in" in out
    assert read_design(folder / "design.h5").evidence["evaluations"] > 0
    assert not psutil.wait_procs(workers, timeout=HANG_SECONDS)[1]


def workers_of(process):
    """The two workers of a design, once they are at work."""
    workers = []
    while len(workers) < 2:
        assert process.poll() is None, process.communicate()
        time.sleep(0.1)
        # One that has begun waits for its parent's death in a thread of its own.
        workers = [
            child
            for child in psutil.Process(process.pid).children()
            if "spawn_main" in " ".join(words_of(child)) and child.num_threads() > 1
        ]
    return workers
