"""Which forests `ddfem` takes: those that are named, or those that come with the package."""

import hashlib
import shutil
from dataclasses import replace

import numpy as np
import pytest

from carillon.errors import UserError
from carillon.fem.geometry import blocks_from_mesh
from forests import coarsen, load_model, save_model
from forests import default as default_forests
from solver.analysis.problem import ProblemOptions, build_problem
from solver.coarsening.forest import forest_or_reason, load_forest
from solver.coarsening.model import block_moduli
from solver.files.modes_file import read_modes
from studies.benchmark.options import BenchmarkOptions
from studies.benchmark.row import benchmark_row
from studies.objectives.measure import BASELINES, rate_objectives
from tests.small_forests import train_small_forests

BOX = ProblemOptions("builtin:box", 8, "noise")
BRIEFLY = BenchmarkOptions(modes=20, runs=1, arpack=False)


@pytest.fixture(scope="module")
def forests(tmp_path_factory, run_cli):
    return train_small_forests(tmp_path_factory.mktemp("forests"), run_cli)


@pytest.fixture
def as_default(forests, monkeypatch):
    """The small forests in the place of those of the package."""
    monkeypatch.setattr(default_forests, "default_path", lambda: forests)


@pytest.fixture
def no_default(monkeypatch):
    def absent():
        raise UserError("default.h5: no such file")

    monkeypatch.setattr(default_forests, "default_path", absent)


def options(**changes) -> ProblemOptions:
    return ProblemOptions(**{**BOX.as_dict(), "coarsen": "ddfem", **changes})


def test_named_and_default_forests_coarsen_by_the_model_they_hold(forests, as_default):
    named = build_problem(options(forest=str(forests)))
    default = build_problem(options())
    e = block_moduli(blocks_from_mesh(named.fine), named.young)
    assert np.array_equal(named.model.young, coarsen(load_forest(forests, 0.25).model, e))
    assert np.array_equal(named.model.young, default.model.young)
    digest = hashlib.sha256(forests.read_bytes()).hexdigest()
    for problem, name in ((named, str(forests)), (default, "default")):
        assert problem.coarsening["forest"] == name
        assert digest.startswith(problem.coarsening["forest_sha256"])
    assert build_problem(BOX).coarsening == {}


def test_forests_of_calibrated_give_the_same_moduli_for_all_ratios(forests, as_default):
    expected = build_problem(options()).model.young
    for poisson in (0.0, 0.33, 0.49):
        for found in (options(poisson=poisson), options(forest=str(forests), poisson=poisson)):
            assert np.array_equal(build_problem(found).model.young, expected)


def test_a_ratio_that_forests_are_not_for_is_answered_with_what_to_train(forests, as_default):
    with pytest.raises(
        UserError, match=r"forests\.h5: trained for Poisson's ratios 0 to 0\.49, the"
    ):
        build_problem(options(forest=str(forests), poisson=-0.1))
    with pytest.raises(UserError) as caught:
        build_problem(options(poisson=0.495))
    for words in ("ratios 0 to 0.49, the model has 0.495", "--poisson 0.495", "--forest"):
        assert words in str(caught.value)


def test_forests_of_fits_at_one_ratio_refuse_others(forests, tmp_path):
    """Those of other objectives, and of `calibrated` at another ratio by earlier versions."""
    model = load_model(forests)
    for changed in (replace(model, objective="hybrid"), replace(model, poisson=0.3)):
        path = tmp_path / "one.h5"
        save_model(path, changed)
        assert changed.ratios == (changed.poisson, changed.poisson)
        assert load_forest(path, changed.poisson).model.ratios == changed.ratios
        sentence = rf"one\.h5: trained for Poisson's ratio {changed.poisson}, the model has 0\.4"
        with pytest.raises(UserError, match=sentence):
            load_forest(path, 0.4)


def test_absent_default_forests_are_left_out_with_a_sentence(no_default, caplog):
    assert forest_or_reason(None, 0.25) == (None, "without ddfem: default.h5: no such file")
    row = benchmark_row(BOX, BRIEFLY)
    assert row["seconds"]["ddfem_ec"] is None and "ddfem" not in row["frequency_error"]
    assert row["without_forest"] == "without ddfem: default.h5: no such file"
    assert caplog.messages[0] == "without ddfem: default.h5: no such file"
    with pytest.raises(UserError):
        forest_or_reason("absent.h5", 0.25)


def test_modes_tell_which_forests_coarsened(forests, tmp_path, run_cli):
    out, copy = tmp_path / "modes.h5", tmp_path / "copy.h5"
    shutil.copy(forests, copy)
    command = ["modes", "builtin:box", "--resolution", 8, "--modes", 12, "--out", out]
    run_cli("solver", *command, "--coarsen", "ddfem", "--forest", copy, check=True)
    found = read_modes(out).attributes
    assert found["forest"] == str(copy) and found["forest_objective"] == "calibrated"
    run_cli("solver", *command, "--coarsen", "average", check=True)
    assert "forest" not in read_modes(out).attributes


def test_forests_stand_beside_the_fit_they_learned(forests):
    found = rate_objectives(options(forest=str(forests)), 60, ("calibrated",))
    assert [row["coarsening"] for row in found["rows"]] == ["calibrated", "ddfem", *BASELINES]
    assert found["forest"]["forest_objective"] == "calibrated"
    fit, forest, galerkin, _ = (row["audible"]["rms"] for row in found["rows"])
    assert fit != forest < 0.5 * galerkin
    assert forest == pytest.approx(fit, rel=0.5)


def test_without_forests_their_row_is_left_out(no_default, caplog):
    found = rate_objectives(BOX, 20, ("chen2015",))
    assert found["forest"] is None and "default.h5" in found["without_forest"]
    assert [row["coarsening"] for row in found["rows"]] == ["chen2015", *BASELINES]
    assert "without ddfem: default.h5" in caplog.text


def test_benchmark_times_the_default_forests(as_default):
    row = benchmark_row(BOX, BRIEFLY)
    assert row["forest"]["forest"] == "default"
    assert row["seconds"]["ddfem"] > 0.0 and row["seconds"]["ddfem_ec_warm"] > 0.0
