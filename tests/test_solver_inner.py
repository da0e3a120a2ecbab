"""The iterative linear solvers of the error correction."""

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


CONTRASTS = {
    "a cell at a corner and one inside": lambda n: np.where(np.arange(n) % (n // 2), 1.0, 1e-9),
    "halves": lambda n: np.where(np.arange(n) < n // 2, 1e-6, 1.0),
    "by cell": lambda n: 1e-6 ** np.random.default_rng(3).uniform(0.0, 1.0, n),
}
"""Shares of their stiffness that so many cells have."""


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("contrast", CONTRASTS)
def test_contrast_converges_or_says_that_it_does_not(contrast, method):
    mesh = solids.box_mesh(12, 9, 8)
    system = inner_checks.system_of(fine_model(mesh, 1e9 * CONTRASTS[contrast](mesh.n_cells)))
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
