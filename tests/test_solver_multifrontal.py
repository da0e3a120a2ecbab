"""Nested dissection and the multifrontal solver against a direct solve by scipy."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from carillon.errors import ConvergenceError
from carillon.fem.model import fine_model
from solver.assembly.node_rows import NodeRows, Pattern
from solver.linear import multifrontal
from solver.linear.multifrontal import Factor
from solver.linear.plan import Plan
from tests import solids


def problem(mesh, seed=0):
    """Rows, plan and integer coordinates of a mesh with random moduli, in mesh node order."""
    young = 1e9 * 10.0 ** np.random.default_rng(seed).uniform(-2.0, 0.0, mesh.n_cells)
    pattern = Pattern.of_cells(mesh.cells.astype(np.int64), 0, mesh.n_nodes)
    rows = NodeRows(pattern)
    rows.add_elements(fine_model(mesh, young).elements)
    planes = mesh.node_grid.astype(np.int64)
    return rows, Plan(planes, pattern.indptr, pattern.columns, leaf_nodes=10), planes


def two_bars():
    """Two bars that do not touch: no front couples them, and a gap is no plane of nodes."""
    near = np.stack(np.meshgrid(range(6), range(2), range(2), indexing="ij"), axis=-1).reshape(
        -1, 3
    )
    return solids.hexmesh_from_grid(np.concatenate([near, near + [0, 0, 6]]), np.zeros(3), 0.01)


MESHES = {
    "box": lambda: solids.box_mesh(7, 5, 4),
    "bar": lambda: solids.box_mesh(20, 1, 1),
    "one cell": lambda: solids.box_mesh(1, 1, 1),
    "two bars": two_bars,
}


@pytest.mark.parametrize("mesh", MESHES)
@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("inside", [False, True])
def test_solutions_are_those_of_a_direct_solver(mesh, threads, inside):
    rows, plan, planes = problem(MESHES[mesh]())
    size = 3 * len(planes)
    K, M = rows.stiffness_csr(size), rows.mass_csr(size)
    # Below the spectrum, where the matrix is definite, and amid it.
    typical = K.diagonal().mean() / M.diagonal().mean()
    shift = 0.37 * typical if inside else -0.01 * typical
    block = np.random.default_rng(1).standard_normal((size, 7))
    found = Factor(plan, rows.stiffness, rows.mass, shift, threads).solve(block)
    expected = splu(sp.csc_matrix(K - shift * M)).solve(block)
    assert np.abs(found - expected).max() < 1e-9 * np.abs(expected).max()


@pytest.mark.parametrize("columns", [1, 7, 24, 50])
def test_threads_that_share_fronts_find_the_same_bits_again(columns):
    """Who takes a ticket differs from run to run."""
    rows, plan, planes = problem(solids.box_mesh(12, 12, 12))
    # Fronts above the branches have several panels and slices.
    assert sum(plan.shares(3).shared) >= 3 and (plan.shares(3).parts[:, 5] > 2).any()
    block = np.random.default_rng(1).standard_normal((3 * len(planes), columns))
    one = Factor(plan, rows.stiffness, rows.mass, -1.0).solve(block)
    factor = Factor(plan, rows.stiffness, rows.mass, -1.0, threads=3)
    first = factor.solve(block)
    np.testing.assert_allclose(first, one, atol=1e-9 * np.abs(one).max())
    for _ in range(20):
        np.testing.assert_array_equal(factor.solve(block), first)


@pytest.mark.parametrize("mesh", MESHES)
def test_every_node_is_eliminated_once_and_fronts_hold_what_they_are_coupled_to(mesh):
    rows, plan, planes = problem(MESHES[mesh]())
    fronts = plan.fronts
    assert sorted(fronts.order) == list(range(len(planes)))
    assert fronts.first[-1] == len(planes)
    for front, parent in enumerate(fronts.parent):
        assert parent == -1 or parent > front
        boundary = fronts.boundary[front]
        assert (np.diff(boundary) > 0).all()
        assert (boundary >= fronts.first[front + 1]).all()
        if parent >= 0:
            # What a front passes on lies in its parent or in what the parent passes on.
            above = boundary[boundary >= fronts.first[parent + 1]]
            assert np.isin(above, fronts.boundary[parent]).all()


@pytest.mark.parametrize("mesh", MESHES)
def test_every_entry_is_in_the_first_front_that_has_its_row_or_column(mesh):
    rows, plan, planes = problem(MESHES[mesh]())
    fronts, pattern = plan.fronts, rows.pattern
    row_of = np.repeat(np.arange(len(planes)), np.diff(pattern.indptr))
    positions = [
        np.append(np.arange(*fronts.first[front : front + 2]), boundary)
        for front, boundary in enumerate(fronts.boundary)
    ]
    numbers = np.concatenate([entries[:, 2] for entries in plan.entries])
    row, column = fronts.position[row_of], fronts.position[pattern.columns]
    front = np.searchsorted(fronts.first, np.arange(len(planes)), side="right")
    assert sorted(numbers) == np.flatnonzero(front[row] <= front[column]).tolist()
    for entries, place in zip(plan.entries, positions, strict=True):
        assert np.array_equal(place[entries[:, 0]], row[entries[:, 2]])
        assert np.array_equal(place[entries[:, 1]], column[entries[:, 2]])
    for front, parent in enumerate(fronts.parent):
        above = np.arange(len(planes)) if parent < 0 else positions[parent]
        assert np.array_equal(above[plan.places[front]], fronts.boundary[front])


def test_dissection_saves_work():
    _, plan, planes = problem(solids.box_mesh(12, 12, 12))
    none = np.zeros(len(planes) + 1, dtype=np.int64)
    whole = Plan(planes, none, none[:0], leaf_nodes=10**6)
    assert plan.operations_of_solve < 0.3 * whole.operations_of_solve


def test_a_factorisation_that_does_not_fit_is_refused(monkeypatch):
    rows, plan, _ = problem(solids.box_mesh(7, 5, 4))
    monkeypatch.setattr(multifrontal, "available_memory", lambda: plan.bytes - 1)
    with pytest.raises(ConvergenceError, match="factorisation of 720 unknowns takes about .* free"):
        Factor(plan, rows.stiffness, rows.mass, -1.0)
    monkeypatch.setattr(multifrontal, "available_memory", lambda: None)
    Factor(plan, rows.stiffness, rows.mass, -1.0)
