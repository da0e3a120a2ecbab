"""The iterative linear solvers of the error correction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from carillon.errors import ConvergenceError
from carillon.fem.model import fine_model
from solver.linear import iterative
from solver.linear.iterative import METHODS, IterativeInverse
from solver.subspace.rayleigh_ritz import safe_shift
from tests import inner_checks, solids
from tests.patience import HANG_SECONDS
from tests.rank_counts import SEVERAL

PROGRAM = Path(__file__).with_name("inner_checks.py")
CHECKS = (
    "solutions_are_those_of_a_direct_solve",
    "columns_are_solved_each_on_its_own",
    "rows_multiply_as_the_matrix_does",
    "multigrid_is_symmetric_positive_definite",
    "failure_is_everyones",
)


@pytest.mark.parametrize("name", CHECKS)
def test_on_one_rank(name):
    getattr(inner_checks, name)()


@pytest.mark.mpi
@pytest.mark.parametrize("ranks", SEVERAL)
def test_on_several_ranks(ranks, mpiexec):
    mpiexec(ranks, PROGRAM, ",".join(CHECKS), timeout=HANG_SECONDS, check=True)


def nearly_void(young: np.ndarray, ratio: float) -> np.ndarray:
    """A cell inside and one at a corner without much stiffness."""
    young[[0, len(young) // 2]] *= ratio
    return young


def contrast_by_halves(young: np.ndarray, ratio: float) -> np.ndarray:
    young[: len(young) // 2] *= ratio
    return young


def contrast_by_cell(young: np.ndarray, ratio: float) -> np.ndarray:
    return young * ratio ** np.random.default_rng(3).uniform(0.0, 1.0, len(young))


MATERIALS = [(nearly_void, 1e-9), (contrast_by_halves, 1e-6), (contrast_by_cell, 1e-6)]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(("change", "ratio"), MATERIALS)
def test_contrast_converges_or_says_that_it_does_not(change, ratio, method):
    mesh = solids.box_mesh(12, 9, 8)
    system = inner_checks.system_of(fine_model(mesh, change(np.full(mesh.n_cells, 1e9), ratio)))
    rhs = inner_checks.right_hand_sides(system, 6)
    tolerance = 1e-6
    inverse = IterativeInverse(system, -safe_shift(system), method, tolerance)
    try:
        solution = inverse.solve(rhs)
    except ConvergenceError as error:
        assert "linear solver" in str(error)
    else:
        residuals = inner_checks.relative_residuals(system, inverse, rhs, solution)
        assert residuals.max() <= 1.01 * tolerance


def test_stagnation_is_an_error(monkeypatch):
    monkeypatch.setattr(iterative, "STALL_ITERATIONS", 20)
    system = inner_checks.system_of(solids.random_box(5, 4, 4))
    # Below rounding, which no residual ever is.
    inverse = IterativeInverse(system, -safe_shift(system), "icc-pcg", 1e-30)
    with pytest.raises(ConvergenceError, match="icc-pcg stopped at a relative residual of"):
        inverse.solve(inner_checks.right_hand_sides(system, 4))


def test_indefinite_matrix_is_an_error():
    system = inner_checks.system_of(solids.random_box(5, 4, 4))
    with pytest.raises(ValueError, match="shift must be negative"):
        IterativeInverse(system, safe_shift(system))
    with pytest.raises(ValueError, match="'cg' is none of the linear solvers"):
        IterativeInverse(system, -1.0, "cg")
