"""A row of the time table: what it says of every method, and how it is measured."""

import json
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

import solver.reference.truth as truth
from carillon.errors import ConvergenceError
from solver.analysis.problem import ProblemOptions
from studies.benchmark.methods import MethodRun, Methods
from studies.benchmark.options import BenchmarkOptions
from studies.benchmark.rivals import SlepcConfiguration, configurations, smallest_without_factor
from studies.benchmark.row import _alternate, benchmark_row, row_lines
from studies.benchmark.scores import speedups, tone_error
from studies.benchmark.solid import CHANGE, make_solid
from studies.benchmark.table import METHODS
from tests import solids

BAR = ProblemOptions("builtin:bar", 20, "smooth")
MODES = 24
COARSE = tuple(name for name, method in METHODS.items() if method.coarse)
TIMED = (
    "arpack",
    "slepc",
    "ddfem",
    "ddfem_rough",
    "hcms",
    "hcms_ec",
    "fastest",
    "ddfem_ec_accurate",
    "ddfem_ec",
    "ddfem_ec_warm",
)


@pytest.fixture(scope="module")
def row(tmp_path_factory, run_cli):
    """A row as the command writes and prints it."""
    out = tmp_path_factory.mktemp("row") / "row.json"
    command = ["benchmark", BAR.mesh, "--resolution", BAR.resolution, "--material", BAR.material]
    options = ["--modes", MODES, "--runs", 2, "--slow-runs", 1, "--tune", "--arpack-regular"]
    done = run_cli("solver", *command, *options, "--json", "--out", out, check=True)
    printed = json.loads(done.stdout)
    assert printed == json.loads(out.read_text())
    return printed


def test_row_has_the_shape_that_tables_rely_on(row):
    assert (row["model"], row["modes"]) == ("bar", MODES)
    assert row["dof_coarse"] < row["dof_fine"]
    assert set(row["seconds"]) == {"precompute", *TIMED, "arpack_regular"}
    assert all(seconds > 0.0 for seconds in row["seconds"].values())
    assert set(row["frequency_error"]) == {"average", "ddfem"}
    for name in ("hcms", "hcms_ec", "fastest", "ddfem_ec", "ddfem_ec_warm"):
        assert set(row["eigenvalue_error"][name]) == {"median", "p90", "max"}
    assert row["precompute_parts"].keys() >= {"mesh", "fine_solver", "coarse_solver"}
    assert row["seconds"]["precompute"] == pytest.approx(sum(row["precompute_parts"].values()))
    assert {"ranks", "threads", "blas", "provenance", "meaning"} <= set(row)


def test_seconds_are_medians_within_their_spread(row):
    for name, between in row["spread"].items():
        assert between["min"] <= row["seconds"][name] <= between["max"]
    slow = ("arpack", "arpack_regular")
    assert all(row["runs"][name] == (1 if name in slow else 2) for name in row["runs"])


def test_every_method_finds_what_it_promises(row):
    errors = row["eigenvalue_error"]
    assert errors["arpack"]["max"] < 1e-8
    assert errors["hcms_ec"]["max"] < 1e-5 < errors["hcms"]["max"]
    assert errors["fastest"]["max"] < 1e-5
    assert errors["ddfem_ec_accurate"]["max"] < 1e-5
    # Both stop on an estimate of the error, 1e-2.
    assert errors["ddfem_ec"]["max"] < 0.05
    assert errors["ddfem_ec_warm"]["max"] < 0.05
    assert errors["ddfem_rough"]["max"] < 0.05
    found = row["frequency_error"]
    assert found["ddfem"]["rms_7_60"] < found["average"]["rms_7_60"]
    assert "lumped mass" in row["problem"]["arpack_regular"]
    assert set(row["missed"]) <= {"slepc", "arpack", "ddfem", "ddfem_rough"}


def test_speedups_name_their_base(row):
    seconds = row["seconds"]
    for method, ratios in row["speedup"].items():
        assert tuple(ratios) == METHODS[method].over
        for base, ratio in ratios.items():
            assert ratio == pytest.approx(seconds[base] / seconds[method])
            assert row["speedup_with_precompute"][method][base] <= ratio


def test_slepc_runs_in_the_fastest_configuration_that_was_tried(row):
    tried = row["slepc_configurations_tried"]
    assert len(tried) == len(configurations(1)) >= 3
    fastest = min(tried, key=lambda entry: entry["seconds"])
    assert row["slepc_configuration"] == {key: fastest[key] for key in ("package", "subspace")}


def test_people_read_every_timed_method(row):
    text = "\n".join(row_lines(row))
    assert all(name in text for name in TIMED)
    assert f"frequencies 7 to {MODES}" in text.replace("of modes ", "")


def test_finite_cells_have_no_coarse_models(caplog):
    cells = ProblemOptions("builtin:bar", 12, discretisation="finite-cell")
    options = BenchmarkOptions(12, runs=1, arpack_regular=True)
    found = benchmark_row(cells, options)
    assert set(found["runs"]) == {"arpack", "slepc", "hcms", "hcms_ec", "fastest"}
    assert max(found["eigenvalue_error"][name]["max"] for name in ("arpack", "hcms_ec")) < 1e-5
    assert found["dof_coarse"] is None and found["frequency_error"] == {}
    assert row_lines(found)[0] == f"{found['dof_fine']:,} unknowns, 12 modes"
    assert caplog.messages == [found["without_forest"]]


def test_methods_alternate(monkeypatch):
    order = []
    for name, method in METHODS.items():
        noted = replace(
            method, run=lambda _, name=name: order.append(name) or MethodRun(1.0, np.empty(0))
        )
        monkeypatch.setitem(METHODS, name, noted)
    noted = Methods(None, MODES, SlepcConfiguration.default(1))
    options = BenchmarkOptions(MODES, runs=3, slow_runs=1)
    runs, failed = _alternate(noted, options, options.left_out)
    assert order[:2] == ["arpack", "slepc"] and order.count("arpack") == 1
    rounds = [name for name in order if name != "arpack"]
    assert rounds == rounds[: len(rounds) // 3] * 3
    assert len(runs["hcms"]) == 3 and failed == {}


def test_a_design_is_timed_beside_few_others_and_the_fine_mesh_less_often():
    options = BenchmarkOptions(MODES, runs=3, fine_runs=1, design=True)
    methods = set(TIMED) - set(options.left_out)
    assert methods == {"slepc", "fastest", *COARSE}
    rounds = {name: options.rounds(name) for name in methods}
    assert rounds == {"slepc": 1, "fastest": 1, **dict.fromkeys(COARSE, 3)}
    asked = BenchmarkOptions(MODES, design=True, rough=True, rivals=["scipy_superlu"])
    assert not {"slepc_rough", "scipy_superlu"} & set(asked.left_out)


def test_a_method_that_fails_is_told_and_the_others_go_on(monkeypatch):
    def fail(_):
        raise ConvergenceError("planted")

    monkeypatch.setitem(METHODS, "ddfem_ec", replace(METHODS["ddfem_ec"], run=fail))
    monkeypatch.setattr("studies.benchmark.row._warm_up", lambda *_: None)
    found = benchmark_row(BAR, BenchmarkOptions(MODES, runs=2, arpack=False))
    assert found["failed"] == {"ddfem_ec": "planted"}
    assert found["seconds"]["ddfem_ec"] is None
    assert "ddfem_ec" not in found["eigenvalue_error"]
    assert found["runs"]["ddfem_ec_warm"] == 2
    assert "planted" in "\n".join(row_lines(found))


def test_modes_that_a_rival_misses_are_found_off_its_clock(monkeypatch):
    search = truth.smallest_eigenpairs

    def lose_the_first(*arguments, **options):
        values, vectors, iterations = search(*arguments, **options)
        lost = slice(int(options["configurable"]), None)
        return values[lost], vectors[:, lost], iterations

    methods = Methods(make_solid(BAR, MODES), MODES, SlepcConfiguration.default(1))
    exact = methods.general("slepc")
    assert exact.added == 0
    monkeypatch.setattr(truth, "smallest_eigenpairs", lose_the_first)
    for run in (methods.general("slepc"), methods.general("arpack")):
        assert run.added == 1
        assert not {"inertia", "completion", "verification"} & set(run.phases)
        assert np.abs(run.values[6:] / exact.values[6:] - 1.0).max() < 1e-9


def test_arpack_without_a_factorisation_finds_the_spectrum_of_the_lumped_mass():
    model = solids.random_box(6, 4, 3, lumped=True)
    exact = solids.dense_eigenvalues(model)[:30]
    values = smallest_without_factor(model, 30, 1e-6, 0, MPI.COMM_SELF)
    assert np.abs(values[6:] / exact[6:] - 1.0).max() < 1e-9
    assert (values[:6] < 1e-9 * exact[6]).all()


def test_moduli_of_the_warm_start_differ_smoothly_and_little():
    solid = make_solid(BAR, MODES)
    change = solid.changed / solid.problem.young - 1.0
    assert np.abs(change).max() == pytest.approx(CHANGE)
    again = make_solid(BAR, MODES)
    assert np.array_equal(solid.changed, again.changed)


def test_nothing_is_faster_than_what_has_no_time():
    assert speedups({"slepc": 1.0, "hcms": None}, {"hcms": ("slepc",)}) == {}


def test_frequency_errors_have_signs():
    exact = np.r_[np.zeros(6), np.linspace(1.0, 2.0, 10)]
    found = exact * np.r_[np.ones(15), 1.21]
    errors = tone_error(found, exact)
    assert errors["worst"] == errors["worst_7_60"] == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["nothing.obj", "--resolution", "16"], "nothing.obj"),
        (["builtin:bar", "--resolution", "16", "--runs", "0"], "--runs"),
        (["builtin:bar", "--resolution", "16", "--slow-runs", "0"], "--slow-runs"),
        (["builtin:bar", "--resolution", "16", "--modes", "200"], "the coarsened model has"),
        (["builtin:bar", "--resolution", "16", "--modes", "6"], "found 6, expected at"),
        (["builtin:bar", "--resolution", "16", "--forest", "absent.h5"], "absent.h5"),
        (["builtin:bar", "--resolution", "16", "--out", "absent/row.json"], "absent"),
    ],
)
def test_bad_arguments_are_answered_in_one_sentence(arguments, sentence, tmp_path, run_cli):
    done = run_cli("solver", "benchmark", *arguments, "--json", cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1 and done.stdout == ""


@pytest.mark.mpi
@pytest.mark.nightly
def test_row_on_two_ranks(mpiexec):
    command = ["benchmark", BAR.mesh, "--resolution", BAR.resolution, "--no-arpack", "--json"]
    done = mpiexec(2, "solver", *command, "--modes", MODES, "--runs", 1, check=True)
    found = json.loads(done.stdout)
    assert found["ranks"] == 2 and found["seconds"]["arpack"] is None
    assert found["eigenvalue_error"]["hcms_ec"]["max"] < 1e-5


def test_a_row_can_do_without_arpack():
    row = benchmark_row(BAR, BenchmarkOptions(MODES, runs=1, arpack=False))
    assert row["seconds"]["arpack"] is None
    assert all("arpack" not in ratios for ratios in row["speedup"].values())
    assert row["problem"] == {}
