"""Further general eigensolvers of the time table: what they find, and what is told of failures."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from carillon.errors import ConvergenceError
from solver.analysis.problem import ProblemOptions
from studies.benchmark.further_rivals import RIVALS, UnavailableError
from studies.benchmark.methods import Methods
from studies.benchmark.options import BenchmarkOptions
from studies.benchmark.rivals import SlepcConfiguration
from studies.benchmark.row import benchmark_row, row_lines
from studies.benchmark.solid import make_solid
from tests import solids

BAR = ProblemOptions("builtin:bar", 20, "smooth")
MODES = 24
MAY_FAIL = ("slepc_lobpcg",)
"""SLEPc's LOBPCG ends with an error of LAPACK."""


@pytest.fixture(scope="module")
def solid():
    return make_solid(BAR, MODES)


def methods(solid, **options):
    return Methods(solid, MODES, SlepcConfiguration.default(1), **options)


def require_installed(name):
    try:
        RIVALS[name].require(1)
    except UnavailableError as error:
        pytest.skip(f"{name}: {error}")


@pytest.fixture(scope="module")
def exact(solid):
    """Eigenvalues with the consistent and with the lumped mass."""
    return {
        lumped: solids.dense_eigenvalues(solid.lumped() if lumped else solid.fine)[:MODES]
        for lumped in (False, True)
    }


@pytest.mark.parametrize("name", RIVALS)
def test_rivals_find_the_lowest_eigenvalues(name, solid, exact):
    require_installed(name)
    try:
        run = methods(solid).further(name)
    except ConvergenceError as error:
        assert name in MAY_FAIL, error
        return
    assert len(run.values) == MODES and run.added == 0 and run.seconds > 0.0
    true = exact[RIVALS[name].lumped]
    assert np.abs(run.values[6:] / true[6:] - 1.0).max() < 1e-8
    assert (run.values[:6] < 1e-6 * true[6]).all()


@pytest.mark.parametrize("name", [name for name in RIVALS if name not in MAY_FAIL])
def test_rivals_that_take_too_long_are_given_up(name, solid):
    require_installed(name)
    with pytest.raises(ConvergenceError, match="did not converge in 1e-09 s"):
        methods(solid, rival_seconds=1e-9).further(name)


def test_modes_that_a_further_rival_misses_are_found_off_its_clock(solid, exact, monkeypatch):
    rival = RIVALS["scipy_superlu"]

    def lose_the_first(search):
        values, vectors = rival.search(search)
        return values[1:], vectors[:, 1:]

    monkeypatch.setitem(RIVALS, "scipy_superlu", replace(rival, search=lose_the_first))
    run = methods(solid).further("scipy_superlu")
    assert run.added == 1
    assert np.abs(run.values[6:] / exact[False][6:] - 1.0).max() < 1e-8


def test_values_that_are_no_eigenvalues_are_a_failure(solid, monkeypatch):
    rival = RIVALS["scipy_superlu"]

    def make_one_up(search):
        values, vectors = rival.search(search)
        made_up = np.linalg.qr(search.start(1))[0]
        return np.r_[values[:1], values], np.concatenate([made_up, vectors], axis=1)

    monkeypatch.setitem(RIVALS, "scipy_superlu", replace(rival, search=make_one_up))
    with pytest.raises(ConvergenceError, match="some of them are none"):
        methods(solid).further("scipy_superlu")


@pytest.mark.parametrize("package", ["primme", "pyamg"])
def test_a_missing_package_gets_a_sentence(package, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    (name, *_) = (name for name, rival in RIVALS.items() if rival.packages[:1] == (package,))
    with pytest.raises(UnavailableError) as caught:
        RIVALS[name].require(1)
    assert str(caught.value).startswith(f"{package} cannot be loaded (")
    assert str(caught.value).endswith("pip install -r workflow/envs/requirements-rivals.txt")


def test_several_ranks_get_a_sentence():
    with pytest.raises(UnavailableError, match="runs on one rank, not on 2"):
        RIVALS["scipy_superlu"].require(2)


def test_a_row_tells_what_further_rivals_took_and_why_others_failed(monkeypatch):
    monkeypatch.setitem(sys.modules, "primme", None)
    asked = ["primme_direct", "scipy_superlu", "slepc_filter"]
    options = BenchmarkOptions(MODES, runs=2, slow_runs=1, arpack=False, rivals=asked)
    row = benchmark_row(BAR, options)
    assert row["seconds"]["scipy_superlu"] > 0.0 and row["runs"]["scipy_superlu"] == 1
    assert row["seconds"]["primme_direct"] is None
    assert list(row["failed"]) == ["primme_direct"]
    assert row["eigenvalue_error"]["scipy_superlu"]["max"] < 1e-8
    assert "lumped mass" in row["problem"]["slepc_filter"]
    assert "slepc_filter" not in row["eigenvalue_error"]
    assert set(asked) <= set(row["meaning"]) and "scipy_lobpcg" not in row["seconds"]
    assert "primme cannot be loaded" in "\n".join(row_lines(row))


def test_all_rivals_are_asked_for_by_one_word():
    assert BenchmarkOptions(rivals=["all"]).further == tuple(RIVALS)
    assert BenchmarkOptions().further == ()


def test_unknown_rivals_get_one_sentence(run_cli):
    done = run_cli("solver", "benchmark", "builtin:bar", "--resolution", "16", "--rivals", "best")
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    assert "scipy_superlu" in done.stderr
