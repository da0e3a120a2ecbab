"""Eigenvalues counted by a factorisation in single precision, and the proof of the count."""

import numpy as np
import pytest

from solver.assembly.system import Layout, assemble
from solver.distribution.local_mesh import distribute
from solver.linear import LinearSolver
from solver.reference import single_precision
from solver.reference.single_precision import count_below, count_in_single, deviation
from tests import solids


@pytest.fixture(scope="module", params=["uniform", "four decades"])
def problem(request):
    """System, solver and eigenvalues of a solid, of one material or of very different ones."""
    random = np.random.default_rng(0)
    model = solids.random_box(9, 6, 5)
    if request.param == "four decades":
        model = model.with_young(10.0 ** random.uniform(6.0, 10.0, model.mesh.n_cells))
    local_mesh = distribute(model, by_planes=True)
    layout = Layout.of_local_mesh(local_mesh)
    system = assemble(local_mesh, layout=layout)
    return system, LinearSolver("multifrontal", layout), solids.dense_eigenvalues(model)


def test_counts_between_eigenvalues_are_proved(problem, monkeypatch):
    system, linear, values = problem
    monkeypatch.setattr(single_precision, "WORTHWHILE", 0.0)
    for below in (6, 20, 60):
        gap = 0.5 * (values[below - 1] + values[below])
        assert count_in_single(linear.tree, system, gap) == below
        assert count_below(linear, system, gap) == below


def test_the_deviation_is_the_largest_eigenvalue_of_what_is_left(problem):
    system, linear, values = problem
    gap = 0.5 * (values[19] + values[20])
    inverse = linear.tree.inverse(system, gap, np.float32)
    matrix = system.rows.stiffness_csr(system.n_dofs) - gap * system.rows.mass_csr(system.n_dofs)
    left = np.eye(system.n_dofs) - inverse.solve(matrix.toarray())
    largest = np.abs(np.linalg.eigvals(left)).max()
    assert 0.2 * largest < deviation(system, inverse, gap) < 5.0 * largest
    exact = linear.tree.inverse(system, gap)
    assert deviation(system, exact, gap) < 1e-6 * largest


def test_a_value_too_near_to_an_eigenvalue_is_counted_in_double_precision(problem, monkeypatch):
    system, linear, values = problem
    monkeypatch.setattr(single_precision, "WORTHWHILE", 0.0)
    near = values[20] * (1.0 + 1e-9)
    assert count_in_single(linear.tree, system, near) is None
    assert count_below(linear, system, near) == 21


def test_little_work_or_little_memory_is_not_worth_it(problem, monkeypatch):
    system, linear, values = problem
    gap = 0.5 * (values[19] + values[20])
    assert count_in_single(linear.tree, system, gap) is None
    monkeypatch.setattr(single_precision, "WORTHWHILE", 0.0)
    monkeypatch.setattr(single_precision, "MEMORY_SHARE", 1e-12)
    assert count_in_single(linear.tree, system, gap) is None
