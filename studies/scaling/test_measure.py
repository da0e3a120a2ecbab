"""Scaling over ranks: what is counted without running is what runs do, and the model is a model."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from carillon.errors import UserError
from carillon.fem.finite_cells.build import finite_cells
from carillon.fem.geometry import builtin_surface, hexmesh_from_voxels, load_surface, voxelize
from carillon.fem.model import fine_model
from solver.distribution.decomposition import decompose
from solver.hcms.counts import Tally
from studies.scaling import launch
from studies.scaling.model import (
    ASSUMED_BANDWIDTH,
    MISFIT_LIMIT,
    CorrectionWork,
    MachineRates,
    as_far_as_it_fits,
    fit_machine,
    kind,
    predict,
    work_of_busiest,
)
from studies.scaling.plan import planned_counts
from studies.scaling.plot import save_plot
from studies.scaling.sizes import sizes_of_box, sizes_of_solid
from studies.scaling.study import PREDICTED, study_lines
from studies.scaling.work import elimination
from tests.cut_solids import uniform
from tests.solids import random_box

BAR = ("builtin:bar", "--resolution", 24, "--material", "smooth")
COUNT = """
import json
import sys
from mpi4py import MPI
from solver.distribution.local_mesh import distribute
from solver.hcms import schedule
from solver.hcms.synthesis import synthesize
from solver.analysis.problem import ProblemOptions, build_problem
from studies.scaling.plan import planned_counts
from studies.scaling.sizes import sizes_of_solid
from solver.distribution.decomposition import decompose

comm, keep = MPI.COMM_WORLD, 60
if len(sys.argv) > 1:
    schedule.SHARED_SIZE, schedule.SHARED_PRODUCTS = 20, 1e3
for discretisation in ("voxel", "finite-cell"):
    options = ProblemOptions("builtin:bar", 24, "smooth", discretisation=discretisation)
    model = build_problem(options).model
    local_mesh = distribute(model, 6, 0, comm)
    found = synthesize(local_mesh, keep, "free", comm).counts.per_rank(comm)
    if comm.rank == 0:
        decomposition, order = decompose(model, 6, 0, comm.size)
        sizes = sizes_of_solid(model, decomposition, order)
        planned = [each.phases() for each in planned_counts(sizes, decomposition.owner, keep)]
        assert list(planned[0]) == list(found)
        for phase in found:
            for name in ("messages", "bytes", "flops"):
                values = [float(getattr(each[phase], name)) for each in planned]
                print(json.dumps([phase, name, values, found[phase][name].tolist()]))
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
def test_planned_counts_are_those_of_a_run(ranks, options, tmp_path, mpiexec):
    program = tmp_path / "count.py"
    program.write_text(COUNT)
    done = mpiexec(ranks, program, *options.split(), check=True)
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert {phase for phase, *_ in rows} >= {"local", "merge 1", "down", "basis"}
    for phase, name, planned, found in rows:
        # Operations of sparse products are counted by entries, some of which may cancel to zero.
        assert planned == pytest.approx(found, rel=0.01), (phase, name)


def test_a_box_of_cubes_is_as_large_as_it_should_be():
    elements = random_box(1, 1, 1).elements
    sizes = sizes_of_box(8, 1000.0, elements)
    assert sizes.nodes[:8] == pytest.approx(1000.0) and sizes.nodes[-1] == pytest.approx(8000.0)
    assert sizes.boundary[0] == pytest.approx(10**3 - 8**3) and sizes.boundary[-1] == 0.0
    # Cubes meet in a face, pairs of them in two, fours of them in four.
    assert sizes.rows_left == pytest.approx([100.0] * 4 + [200.0] * 2 + [400.0])
    # Where quadratic cells meet, one or two of their layers belong to a group.
    quadratic = sizes_of_box(8, 1000.0, uniform(finite_cells(builtin_surface("box"), 4)).elements)
    assert quadratic.rows_left == pytest.approx(1.5 * sizes.rows_left)
    assert quadratic.pairs_across == pytest.approx(2.0 * 16.0 / 9.0 * sizes.pairs_across)
    with pytest.raises(ValueError, match="power of two"):
        sizes_of_box(6, 1000.0, elements)


def test_more_ranks_have_less_to_do_each_and_more_to_say():
    mesh = bar()
    model = fine_model(mesh, np.ones(mesh.n_cells))
    sizes = sizes_of_solid(model, *decompose(model, 8, 0, 1))
    work = elimination(model)
    correction = CorrectionWork(blocks=2, solves=100, width=70)
    alone, many = (work_of_busiest(sizes, work, 60, correction, ranks) for ranks in (1, 8))
    for phase in ("local", "basis", "factor", "solve"):
        assert many[phase].flops < alone[phase].flops
    assert sum(tally.messages for tally in alone.values()) == 0.0
    assert all(many[phase].messages > 0.0 for phase in ("merge 1", "down", "factor", "dense"))
    (counts,) = planned_counts(sizes, np.zeros(8, dtype=int), 60)
    assert alone["local"].flops == counts.local.flops


def run(ranks: int, seconds: float, oversubscribed: bool = False) -> dict:
    """A measured run in which every rank does a gigaflop in every phase."""
    quantities = {"seconds": seconds, "waiting": 0.0, "flops": 1e9, "bytes": 0.0, "messages": 0.0}
    phase = {name: [value] * ranks for name, value in quantities.items()}
    return {
        "ranks": ranks,
        "oversubscribed": oversubscribed,
        "phases": {"local": phase, "merge 1": phase, "merge 2": phase},
        "link": {"latency": 1e-6, "bandwidth": 1e9} if ranks > 1 else None,
    }


def test_rates_are_fitted_to_runs_that_have_their_cores():
    machine = fit_machine([run(1, 0.5), run(2, 0.5), run(8, 50.0, oversubscribed=True)])
    assert machine.rates["local"] == machine.rates["merge"] == pytest.approx(2e9)
    assert (machine.latency, machine.bandwidth) == (1e-6, 1e9)
    assert fit_machine([run(1, 0.5)]).bandwidth == ASSUMED_BANDWIDTH
    assert fit_machine([run(1, 0.5)], latency=5e-6, bandwidth=1e10).latency == 5e-6


def test_time_is_that_of_operations_bytes_and_messages():
    machine = MachineRates({"merge": 1e9}, latency=1e-3, bandwidth=1e6)
    seconds = predict(machine, {"merge 3": Tally(messages=10, bytes=2e6, flops=3e9)})
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
    models = [found[kind]["model"] for kind in ("strong", "weak")]
    assert all(model["fit"] in lines for model in models)
    far = [line for line in lines if "1024 ranks" in line and "model" in line]
    assert len(far) == sum(model["misfit"] <= MISFIT_LIMIT for model in models)
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
            return "no memory"
        Path(command[-1]).write_text('{"ranks": 1, "seconds": 1.0}')
        return None

    monkeypatch.setattr(launch, "_run", run_on_one)
    found, failed = launch.measure_each({1: ["builtin:bar"], 2: ["builtin:bar"]})
    assert [run["ranks"] for run in found] == [1] and failed == {2: "no memory"}
    with pytest.raises(UserError, match="the run on 2 ranks failed: no memory"):
        launch.measure_each({2: ["builtin:bar"]})
    monkeypatch.setattr(launch.shutil, "which", lambda _: None)
    with pytest.raises(UserError, match="no mpiexec on PATH"):
        launch.measure_each({2: ["builtin:bar"]})


def test_absent_folders_are_not_made(tmp_path, run_cli):
    run_cli("solver", "scaling", *BAR, "--out", Path("absent") / "x.json", cwd=tmp_path)
    assert list(tmp_path.iterdir()) == []
