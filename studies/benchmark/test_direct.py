"""Direct solvers beside Carillon's own: all solve the same systems, and absent ones are named."""

import json
import sys

import numpy as np
import pytest

from solver.analysis.problem import ProblemOptions, build_problem
from studies.benchmark.direct import DirectOptions, compare, table_lines
from studies.benchmark.direct_solvers import SOLVERS
from studies.benchmark.further_rivals import UnavailableError, require_packages

BAR = ProblemOptions("builtin:bar", 16, "smooth")
LARGEST_RESIDUAL = 1e-6
"""Rounding errors times the condition of K - shift M, about 1e8, leave less."""


@pytest.fixture(scope="module")
def bar():
    return build_problem(BAR).model


@pytest.fixture(scope="module", params=[True, False], ids=["definite", "indefinite"])
def result(bar, request):
    return compare(bar, DirectOptions(definite=request.param, modes=24, runs=1))


def test_every_solver_solves_or_says_why_not(result):
    rows, failed = result["solvers"], result["failed"]
    assert {*rows, *failed} == set(SOLVERS) and not {*rows} & {*failed}
    assert {"own", "superlu"} <= set(rows)
    assert ("shift below" in failed.get("cholmod", "")) == (result["shift"] > 0.0)
    for row in rows.values():
        assert 0.0 < row["residual"] < LARGEST_RESIDUAL
        assert row["wall_factorisation"] > 0.0 and row["wall_solves_24"] > 0.0
        # No more than a full matrix has, which pivots as 2 x 2 blocks may store twice.
        assert 0 < row["bytes"] <= 2 * 8 * result["n_dofs"] ** 2


def test_counts_of_operations_are_those_of_a_sparse_factorisation(result):
    counts = {name: row["gigaflop"] for name, row in result["solvers"].items()}
    assert counts["own"] is not None and counts["superlu"] is None
    for count in filter(None, counts.values()):
        assert count < 1e-9 * result["n_dofs"] ** 3 / 3.0


def test_the_table_has_a_line_for_each_solver(result):
    lines = table_lines(result)
    assert lines[0].startswith(f"{result['n_dofs']:,} unknowns")
    assert [line.split()[0].rstrip(":") for line in lines[2:]] == [
        *result["solvers"],
        *result["failed"],
    ]


def test_absent_pardiso_gets_a_sentence(bar, monkeypatch):
    monkeypatch.setitem(sys.modules, "pypardiso", None)
    result = compare(bar, DirectOptions(True, runs=1, warm_up=False, solvers=("pardiso",)))
    assert not result["solvers"]
    assert result["failed"]["pardiso"].startswith("pypardiso cannot be loaded (")


def test_pardiso_solves_blocks_and_single_vectors():
    try:
        require_packages("pypardiso")
    except UnavailableError as error:
        pytest.skip(str(error))
    import scipy.sparse as sp

    from studies.benchmark.pardiso import Pardiso

    matrix = sp.csr_matrix([[4.0, 1.0, 0.0], [1.0, -3.0, 2.0], [0.0, 2.0, 5.0]])
    solver = Pardiso(matrix, definite=False)
    solver.analyse()
    solver.factorise()
    block = np.asfortranarray(np.arange(6.0).reshape(3, 2))
    exact = np.linalg.solve(matrix.toarray(), block)
    np.testing.assert_allclose(solver.solve(block), exact, rtol=1e-12)
    np.testing.assert_allclose(solver.solve(block[:, 0]), exact[:, 0], rtol=1e-12, atol=1e-15)
    solver.destroy()


def test_the_command_prints_json(run_cli):
    done = run_cli(
        *("solver", "benchmark-direct", "builtin:bar", "--resolution", "12", "--json"),
        *("--definite", "--runs", "1", "--no-warm-up", "--solvers", "own"),
    )
    assert done.returncode == 0, done.stderr
    printed = json.loads(done.stdout)
    assert list(printed["solvers"]) == ["own"] and printed["provenance"]["threads"] >= 1
