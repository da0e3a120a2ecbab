"""Scaling over ranks: what is counted without running is what runs do, and the model is a model."""

import json
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from carillon.errors import UserError
from carillon.fem.geometry import hexmesh_from_voxels, load_surface, voxelize
from carillon.fem.model import fine_model
from solver.hcms.counts import Tally
from solver.rank_scaling import BANDWIDTH
from studies.scaling import launch
from studies.scaling.model import (
    MISFIT_LIMIT,
    MachineRates,
    as_far_as_it_fits,
    fit_machine,
    kind,
)
from studies.scaling.plot import save_plot
from studies.scaling.runs import PREDICTED, growing_trees, study_lines, trees_of_solid
from studies.scaling.work import Request, balanced_tree, busiest

BAR = ("builtin:bar", "--resolution", 24, "--material", "smooth")
COUNT = """
import json
import sys
from mpi4py import MPI
from solver.distribution.local_mesh import distribute
from solver.hcms import schedule
from solver.hcms.synthesis import synthesize
from solver.analysis.problem import ProblemOptions, build_problem
from studies.scaling.work import Request, busiest

comm, keep = MPI.COMM_WORLD, 60
if len(sys.argv) > 1:
    schedule.SHARED_SIZE, schedule.SHARED_PRODUCTS = 20, 1e3
for discretisation in ("voxel", "finite-cell"):
    options = ProblemOptions("builtin:bar", 24, "smooth", discretisation=discretisation)
    local_mesh = distribute(build_problem(options).model, 6, 0, comm)
    counted = synthesize(local_mesh, keep, "free", comm).counts.per_rank(comm)
    if comm.rank == 0:
        decomposition = local_mesh.decomposition
        nodes = [float(stop - start) for start, stop in decomposition.row_ranges()]
        work = busiest(decomposition.tree, nodes, Request(keep, 1, 10, 60), comm.size)
        for phase, quantities in counted.items():
            flops, messages = (float(quantities[name].max()) for name in ("flops", "messages"))
            print(json.dumps([phase, work[phase].flops, flops, work[phase].messages, messages]))
"""


def bar():
    return hexmesh_from_voxels(voxelize(load_surface("builtin:bar"), 24))


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("ranks", "options"),
    [
        *(
            pytest.param(*each, marks=pytest.mark.nightly)
            for each in [(1, ""), (2, ""), (6, "shared")]
        ),
        (3, ""),
    ],
)
def test_work_of_the_busiest_rank_is_what_a_run_counts(ranks, options, tmp_path, mpiexec):
    program = tmp_path / "count.py"
    program.write_text(COUNT)
    done = mpiexec(ranks, program, *options.split(), check=True)
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert {phase for phase, *_ in rows} >= {"local", "merge 1", "down", "basis"}
    for phase, flops, counted, messages, sent in rows:
        # Merges are counted for compact groups, which the parts of a bar are not.
        factor = 2.5 if kind(phase) == "merge" else 1.01
        assert counted / factor <= flops <= factor * counted, phase
        assert (messages > 0.0) == (sent > 0.0), phase


def test_equal_subdomains_are_joined_in_pairs():
    tree = balanced_tree(3)
    assert tree.parts == 8 and tree.levels() == [0] * 8 + [1] * 4 + [2] * 2 + [3]
    assert tree.ranges()[8:] == [(0, 2), (2, 4), (4, 6), (6, 8), (0, 4), (4, 8), (0, 8)]
    trees = growing_trees({"n_dofs": 6000, "ranks": 2, "subdomains": 8})
    tree, nodes = trees[4]
    assert tree.parts == 16 and nodes[0] == pytest.approx(250.0) and nodes[-1] == 4000.0


def test_more_ranks_have_less_to_do_each_and_more_to_say():
    mesh = bar()
    trees = trees_of_solid(fine_model(mesh, np.ones(mesh.n_cells)), (1, 8, 64), 0)
    assert trees[64][0].parts >= 64
    # Fronts of the bar are narrower than the panels that ranks share them by.
    tree = balanced_tree(3)
    nodes = [1e3 * 2**level for level in tree.levels()]
    request = Request(keep=60, blocks=2, solves=100, width=70)
    alone, many = (busiest(tree, nodes, request, ranks) for ranks in (1, 8))
    for phase in ("assembly", "local", "basis", "factor", "solve", "dense"):
        assert many[phase].flops < alone[phase].flops
    assert sum(tally.messages for tally in alone.values()) == 0.0
    assert all(many[phase].messages > 0.0 for phase in ("merge 1", "down", "factor", "dense"))


def run(ranks: int, seconds: float, oversubscribed: bool = False) -> dict:
    """A measured run in which every phase takes all ranks so long."""
    phase = {"seconds": [seconds] * ranks}
    return {
        "ranks": ranks,
        "oversubscribed": oversubscribed,
        "phases": {"local": phase, "merge 1": phase, "merge 2": phase},
        "link": {"latency": 1e-6, "bandwidth": 1e9} if ranks > 1 else None,
    }


def test_rates_are_fitted_to_runs_that_have_their_cores():
    work = {phase: Tally(flops=1e9) for phase in ("local", "merge 1", "merge 2")}
    runs = [run(1, 0.5), run(2, 0.5), run(8, 50.0, oversubscribed=True)]
    machine = fit_machine([(each, work) for each in runs])
    assert machine.rates["local"] == machine.rates["merge"] == pytest.approx(2e9)
    assert (machine.latency, machine.bandwidth) == (1e-6, 1e9)
    alone = [(run(1, 0.5), work)]
    assert fit_machine(alone).bandwidth == BANDWIDTH
    assert fit_machine(alone, latency=5e-6, bandwidth=1e10).latency == 5e-6


def test_waiting_is_no_work():
    busy = run(2, 0.5)
    busy["phases"]["local"] = {"seconds": [0.5, 0.5], "waiting": [0.0, 0.4]}
    busy["phases"]["merge 1"] = {"seconds": [0.5, 0.5], "waiting": [0.4, 0.3]}
    work = {"local": Tally(flops=1e9), "merge 1": Tally(flops=1e9)}
    rates = fit_machine([(busy, work)]).rates
    assert rates["local"] == pytest.approx(2e9) and rates["merge"] == pytest.approx(5e9)


def test_time_is_that_of_operations_bytes_and_messages():
    machine = MachineRates({"merge": 1e9}, latency=1e-3, bandwidth=1e6)
    seconds = machine.predict({"merge 3": Tally(messages=10, bytes=2e6, flops=3e9)})
    assert seconds == {"merge 3": pytest.approx(3.0 + 2.0 + 0.01)}
    assert kind("merge 3") == "merge"


def row(ranks: int, seconds: float) -> dict:
    """A row of the model."""
    return {"ranks": ranks, "total": seconds}


@given(
    measured=st.dictionaries(st.integers(1, 8), st.floats(0.1, 10.0), min_size=1),
    errors=st.lists(st.floats(-0.9, 2.0), min_size=8, max_size=8),
    crowded=st.sets(st.integers(1, 8)),
)
def test_a_model_goes_beyond_its_measurements_only_where_it_fits_them(measured, errors, crowded):
    runs = [run(ranks, seconds, ranks in crowded) for ranks, seconds in measured.items()]
    for each, seconds in zip(runs, measured.values(), strict=True):
        each["seconds"] = seconds
    rows = [row(n, measured.get(n, 1.0) * (1.0 + errors[n - 1])) for n in range(1, 9)]
    found = as_far_as_it_fits(runs, [*rows, row(1024, 1.0)])
    fair = [n for n in measured if n not in crowded] or list(measured)[:1]
    worst = max(abs(errors[n - 1]) for n in fair)
    assert found["misfit"] == pytest.approx(worst)
    kept = {each["ranks"] for each in found["rows"]}
    assert kept == ({*range(1, 9), 1024} if found["misfit"] <= MISFIT_LIMIT else set(measured))
    assert f"up to {found['misfit']:.0%}" in found["fit"]
    assert ("left out" in found["fit"]) == (found["misfit"] > MISFIT_LIMIT)


def test_a_model_without_a_measurement_beside_it_goes_nowhere():
    found = as_far_as_it_fits([run(3, 1.0) | {"seconds": 1.0}], [row(1, 1.0), row(2, 0.5)])
    assert found["misfit"] is None and found["rows"] == [] and "left out" in found["fit"]


@pytest.fixture(scope="module")
def study(tmp_path_factory, run_cli):
    """Result of the command and its plot."""
    folder = tmp_path_factory.mktemp("scaling")
    out, plot = folder / "scaling.json", folder / "scaling.png"
    options = ("--modes", 30, "--ranks", "2,1,3", "--weak", "--out", out, "--plot", plot)
    run_cli("solver", "scaling", *BAR, *options, check=True)
    return json.loads(out.read_text()), plot


@pytest.mark.mpi
@pytest.mark.nightly
def test_study_measures_and_models_and_says_which(study):
    found, plot = study
    assert plot.stat().st_size > 10_000
    strong = found["strong"]
    assert [run["ranks"] for run in strong["runs"]] == [1, 2, 3] and strong["failed"] == {}
    for each in strong["runs"]:
        phases = each["phases"]
        assert {"assembly", "local", "merge 1", "down", "factor", "solve", "dense"} <= set(phases)
        assert all(len(values) == each["ranks"] for values in phases["local"].values())
        assert len(each["peak_memory_bytes"]) == each["ranks"]
        assert each["oversubscribed"] == (each["ranks"] > each["cores"])
        assert each["slowest_seconds"] >= each["seconds"] > 0.0
    assert sum(strong["runs"][0]["phases"]["merge 1"]["messages"]) == 0.0
    assert sum(strong["runs"][2]["phases"]["down"]["messages"]) > 0.0
    model = strong["model"]
    assert "not a measurement" in model["note"] and len(model["assumptions"]) > 5
    modelled = {row["ranks"] for row in model["rows"]}
    assert modelled >= ({1, 2, 3, 16} if model["misfit"] <= MISFIT_LIMIT else {1, 2, 3})
    weak = found["weak"]["runs"]
    assert weak[2]["n_dofs"] > 2 * weak[0]["n_dofs"]
    model = found["weak"]["model"]
    expected = PREDICTED if model["misfit"] <= MISFIT_LIMIT else (1, 2)
    assert [row["ranks"] for row in model["rows"]] == list(expected)


@pytest.mark.mpi
@pytest.mark.nightly
def test_people_read_what_is_measured_and_what_is_modelled(study, tmp_path):
    found, _ = study
    lines = study_lines(found)
    assert lines[0].startswith("strong scaling")
    for scaling in (found["strong"], found["weak"]):
        assert scaling["model"]["fit"] in lines
        measured = {run["ranks"] for run in scaling["runs"]}
        for row in scaling["model"]["rows"]:
            about = [line for line in lines if f" {row['ranks']} ranks" in line]
            assert any("model" in line for line in about)
            assert all("unknowns" in line for line in about) or row["ranks"] not in measured
    save_plot({**found, "weak": None}, tmp_path / "strong.svg")
    assert (tmp_path / "strong.svg").read_text().startswith("<?xml")


@pytest.mark.nightly
@pytest.mark.mpi
def test_started_under_mpiexec_it_measures_the_ranks_it_has(mpiexec):
    done = mpiexec(2, "solver", "scaling", *BAR, "--modes", 30, "--json", check=True)
    found = json.loads(done.stdout)
    assert found["ranks"] == 2 and found["link"]["bandwidth"] > 0.0


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["nothing.obj", "--resolution", 16], "nothing.obj"),
        ([*BAR, "--ranks", "0"], "--ranks"),
        ([*BAR, "--ranks", "one"], "--ranks"),
        ([*BAR, "--tol", "0"], "--tol"),
        ([*BAR, "--bandwidth", "-1"], "--bandwidth"),
        ([*BAR, "--plot", "absent/plot.png"], "absent"),
    ],
)
def test_bad_arguments_are_answered_in_one_sentence(arguments, sentence, tmp_path, run_cli):
    done = run_cli("solver", "scaling", *arguments, cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_run_that_fails_is_told_and_the_others_go_on(monkeypatch):
    def run_on_one(command, _):
        if command[command.index("-n") + 1] != "1":
            return CompletedProcess(command, 2, "", "bound to cores\nsolver scaling: no memory\n")
        Path(command[-1]).write_text('{"ranks": 1, "seconds": 1.0}')
        return CompletedProcess(command, 0, "", "")

    monkeypatch.setattr(launch, "run_child", run_on_one)
    found, failed = launch.measure_each({1: ["builtin:bar"], 2: ["builtin:bar"]})
    assert [run["ranks"] for run in found] == [1] and failed == {2: "solver scaling: no memory"}
    with pytest.raises(UserError, match="the run on 2 ranks failed: .*: no memory"):
        launch.measure_each({2: ["builtin:bar"]})
    monkeypatch.setattr(launch.shutil, "which", lambda _: None)
    with pytest.raises(UserError, match="no mpiexec on PATH"):
        launch.measure_each({2: ["builtin:bar"]})


def test_absent_folders_are_not_made(tmp_path, run_cli):
    run_cli("solver", "scaling", *BAR, "--out", Path("absent") / "x.json", cwd=tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_speed_ups_are_told_without_a_run(run_cli):
    options = ("--unknowns", "78462,1000000", "--ranks", "1,1024", "--modes", 64)
    lines = run_cli("carillon", "study", "speed-up", *options, check=True).stdout.splitlines()
    assert [line.split()[3] for line in lines[1:5:2]] == ["1.0", "1.0"]
    assert "shared fronts" in lines[4] and lines[-1].startswith("assumed: ")
