"""Spectra of a solid coarsened by every objective, and the materials they are judged on."""

import json

import numpy as np
import pytest

from carillon.fem.geometry import hexmesh_from_voxels, load_surface, voxelize
from carillon.fem.materials import NAMES, young_modulus
from dataset_gen.objectives import OBJECTIVES, fit
from solver.analysis.modal_solver import modal_analysis
from solver.analysis.options import SolverOptions
from solver.analysis.problem import ProblemOptions, build_problem
from solver.coarsening.choice import FitCoarsening, make_coarsening
from solver.coarsening.model import build_model
from solver.files.modes_file import frequencies, read_modes
from solver.verification.matching import frequency_errors
from studies.objectives.measure import BASELINES, FOREST, rate_objectives
from tests import solids

BOX = ProblemOptions("builtin:box", 8, "noise")
CHOSEN = ("chen2015", "oversampled")


@pytest.fixture(scope="module")
def rated():
    found = rate_objectives(BOX, 256, CHOSEN)
    # The row of the forests is there if there are default ones: tests/test_solver_forests.py.
    found["rows"] = [row for row in found["rows"] if row["coarsening"] != FOREST]
    return found


@pytest.mark.parametrize("resolution", [16, 24])
def test_the_box_consists_of_whole_blocks(resolution):
    voxels = voxelize(load_surface("builtin:box"), resolution)
    assert voxels.shape == (resolution, resolution * 3 // 4, resolution // 2)
    assert voxels.filled.all()


@pytest.mark.parametrize("name", NAMES)
def test_named_materials_are_positive_and_the_same_again(name):
    mesh = solids.box_mesh(6, 4, 4)
    young = young_modulus(name, mesh, seed=3)
    assert young.shape == (mesh.n_cells,) and (young > 0.0).all()
    assert np.array_equal(young, young_modulus(name, mesh, seed=3))


def test_noise_is_uniform_between_its_bounds_and_random_is_uniform_in_the_logarithm():
    mesh = hexmesh_from_voxels(voxelize(load_surface("builtin:box"), 24))
    for name, middle in (("noise", 5.005e9), ("random", 10**8.5)):
        young = young_modulus(name, mesh)
        assert young.min() >= 1e7 and young.max() <= 1e10
        assert np.median(young) == pytest.approx(middle, rel=0.15)


def test_blocks_fitted_once_are_blocks_fitted_each():
    e = np.random.default_rng(0).choice([0.0, 1e8, 1e10], (40, 8))
    e = np.concatenate([e, e[::-1]])
    e[:, 0] = 1e9
    found = FitCoarsening("oversampled", 0.25).fits(e)
    for once, each in zip(found, fit("oversampled", e, 0.25)):
        assert np.array_equal(once, each)


def test_errors_are_those_of_the_model_coarsened_by_the_objective(rated):
    assert [row["coarsening"] for row in rated["rows"]] == [*CHOSEN, *BASELINES]
    problem = build_problem(BOX)
    exact = np.array(rated["truth"]["frequencies_hz"])
    for row in rated["rows"]:
        name = row["coarsening"]
        method = name if name in BASELINES else "fit"
        coarsening = make_coarsening(method, objective=_objective(name))
        model = build_model(problem.fine, problem.young, coarsening)
        options = SolverOptions(method="slepc", modes=60, check_inertia=False)
        found = frequencies(modal_analysis(model, options).values)
        error = found[6:] / exact[6:60] - 1.0
        assert row["audible"]["rms"] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-6)
        assert row["audible"]["mean"] == pytest.approx(error.mean(), rel=1e-6)
        worst = row["audible"]["worst_mode"] - 7
        assert row["audible"]["worst"] == pytest.approx(error[worst], rel=1e-6)
        assert abs(error[worst]) == pytest.approx(np.abs(error).max())


def _objective(name: str) -> str:
    return name if name in OBJECTIVES else CHOSEN[0]


def test_a_coarse_model_with_too_few_modes_is_judged_by_those_it_has(rated):
    assert rated["coarse_n_dofs"] == 180 < rated["modes"]
    for row in rated["rows"]:
        assert (row["audible"]["first"], row["audible"]["last"]) == (7, 60)
        assert (row["all"]["first"], row["all"]["last"]) == (7, 180)
        assert len(row["frequencies_hz"]) == 180
        assert (row["converged"] is None) == (row["coarsening"] in BASELINES)


def test_truth_carries_its_proof_and_equal_blocks_are_counted_once(rated):
    truth = rated["truth"]
    assert truth["inertia_count"] == truth["inertia_expected"] >= 256
    assert truth["residual_max"] < 1e-8 and truth["rigid_modes"] == 6
    assert rated["blocks"] == rated["distinct_blocks"] == 24


def test_the_worst_error_keeps_its_sign():
    errors = frequency_errors(np.array([0.01, -0.3, 0.2, 0.5]), last=9)
    assert (errors.worst, errors.worst_mode, errors.last) == (-0.3, 8, 9)
    assert errors.mean == pytest.approx(-0.03)


def test_command_writes_what_it_prints(tmp_path, run_cli):
    out = tmp_path / "box.json"
    command = ["objectives", "builtin:box", "--resolution", 8, "--modes", 40]
    command += ["--objectives", ",".join(CHOSEN), "--out", out]
    done = run_cli("solver", *command, check=True)
    found = json.loads(out.read_text())
    assert found["provenance"]["commit"] and found["provenance"]["config_hash"]
    for row in found["rows"]:
        assert f"{row['audible']['rms']:.1%}" in done.stdout
    printed = json.loads(run_cli("solver", *command, "--json", check=True).stdout)
    assert [row["all"] for row in printed["rows"]] == [row["all"] for row in found["rows"]]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--objectives", "chen2015,guess"], "objective 'guess' is unknown"),
        (["--modes", "5000"], "5,000 modes asked for"),
        (["--out", "absent/box.json"], "the folder absent does not exist"),
    ],
)
def test_bad_arguments_are_answered_in_one_sentence(arguments, sentence, run_cli):
    done = run_cli("solver", "objectives", "builtin:box", "--resolution", "8", *arguments)
    assert done.returncode == 2
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1


def test_modes_can_be_computed_with_any_objective(tmp_path, run_cli):
    found = {}
    for name in CHOSEN:
        out = tmp_path / f"{name}.h5"
        command = ["modes", "builtin:box", "--resolution", 8, "--material", "noise"]
        command += ["--coarsen", "fit", "--objective", name, "--modes", 20, "--out", out]
        run_cli("solver", *command, check=True)
        file = read_modes(out)
        assert file.attributes["objective"] == name
        found[name] = file.frequencies
    assert found["chen2015"][6] < 0.9 * found["oversampled"][6]
