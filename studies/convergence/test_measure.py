"""Convergence of corrections by start and acceleration (Fig. 10)."""

import json

import numpy as np
import pytest

from solver.correction.criteria import ACCELERATIONS
from solver.hcms.condense import INTERFACES
from studies.convergence.measure import STARTS, STEPWISE

BAR = ("builtin:bar", "--resolution", "24", "--material", "smooth")
MODES = 50
STEPS = 3


def curves(history: dict, acceleration: str) -> dict[str, np.ndarray]:
    """Values (steps + 1, modes - 6) by start."""
    return {
        curve["start"]: np.array(curve["values"])
        for curve in history["histories"]
        if curve["acceleration"] == acceleration
    }


@pytest.fixture(scope="module")
def truth(tmp_path_factory, run_cli):
    path = tmp_path_factory.mktemp("truth") / "truth.h5"
    options = ("--modes", MODES, "--method", "slepc", "--out", path)
    run_cli("solver", "modes", *BAR, *options, check=True)
    return path


@pytest.fixture(scope="module")
def history(truth, tmp_path_factory, run_cli) -> dict:
    """What the command finds on one rank."""
    out = tmp_path_factory.mktemp("history") / "1.json"
    options = ("--modes", MODES, "--steps", STEPS, "--truth", truth, "--out", out)
    run_cli("solver", "convergence", *BAR, *options, check=True)
    return dict(json.loads(out.read_text()))


def test_every_interface_and_acceleration_is_followed():
    assert set(STARTS) == {*(f"hcms-{interface}" for interface in INTERFACES), "random"}
    assert set(STEPWISE) == {"krylov", "relaxation"} == set(ACCELERATIONS) - {"lanczos"}


def test_histories_are_complete_and_errors_those_of_the_values(history):
    exact = np.array(history["exact"])
    assert len(history["histories"]) == len(STARTS) * len(STEPWISE)
    for curve in history["histories"]:
        values = np.array(curve["values"])
        assert values.shape == (STEPS + 1, MODES - 6)
        worst = [errors["max"] for errors in curve["eigenvalue_error"]]
        assert np.abs(values / exact - 1.0).max(axis=1) == pytest.approx(worst)


def test_ritz_values_never_fall_below_the_exact_ones(history):
    exact = np.array(history["exact"])
    for acceleration in STEPWISE:
        for values in curves(history, acceleration).values():
            assert (values >= exact * (1.0 - 1e-8)).all()


@pytest.mark.parametrize("acceleration", STEPWISE)
def test_synthesis_is_the_better_start(history, acceleration):
    found = curves(history, acceleration)
    for start in STARTS:
        assert (found[start][1] <= found["random"][1] * (1.0 + 1e-9)).all()
    free = [errors["median"] for errors in _errors(history, "hcms-free", acceleration)]
    assert free[-1] < 1e-2 * free[0]


@pytest.mark.nightly
@pytest.mark.mpi
def test_truth_and_lowest_values_do_not_depend_on_the_number_of_ranks(history, mpiexec, tmp_path):
    out = tmp_path / "2.json"
    # It finds the truth by itself.
    options = ("--modes", MODES, "--steps", STEPS, "--out", out)
    mpiexec(2, "solver", "convergence", *BAR, *options, check=True)
    one, two = history, json.loads(out.read_text())
    assert one["exact"] == pytest.approx(two["exact"], rel=1e-8)
    for acceleration in STEPWISE:
        ours, theirs = (curves(each, acceleration) for each in (one, two))
        for interface in INTERFACES:
            lowest = slice(0, 5)
            start = f"hcms-{interface}"
            assert np.allclose(ours[start][-1, lowest], theirs[start][-1, lowest], rtol=1e-4)


def _errors(history: dict, start: str, acceleration: str) -> list[dict]:
    for curve in history["histories"]:
        if (curve["start"], curve["acceleration"]) == (start, acceleration):
            return curve["eigenvalue_error"]
    raise KeyError((start, acceleration))


def test_a_truth_of_another_solid_is_refused(truth, tmp_path, run_cli):
    out = tmp_path / "history.json"
    command = ["convergence", "builtin:bar", "--resolution", 16, "--out", out, "--truth", truth]
    done = run_cli("solver", *command, "--modes", 40)
    assert done.returncode == 2
    assert "expected 40 or more of" in done.stderr and done.stderr.count("\n") == 1
    assert not out.exists()
