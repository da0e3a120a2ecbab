"""The coarse model: mass, stiffness bounds, and spectra near the fine one."""

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from mpi4py import MPI

from carillon.errors import UserError
from carillon.fem.geometry import blocks_from_mesh, hexmesh_from_grid, prolongation
from solver.analysis.modal_solver import modal_analysis
from solver.analysis.options import SolverOptions
from solver.assembly.sparse import assembled
from solver.coarsening.choice import METHODS, make_coarsening
from solver.coarsening.model import build_model
from tests import solids


def carved_box(nx: int, ny: int, nz: int):
    """Mesh of a box with a corner and a groove cut away, so that some blocks are partly void."""
    grid = solids.box_mesh(nx, ny, nz).grid
    corner = (grid >= np.array([nx, ny, nz]) - 3).all(axis=1)
    groove = (grid[:, 0] == 2) & (grid[:, 2] == nz - 1)
    return hexmesh_from_grid(grid[~(corner | groove)], np.zeros(3), 0.01)


def test_galerkin_coarsening_is_the_projection_of_the_fine_matrices():
    mesh = carved_box(6, 5, 4)
    young = 10.0 ** np.random.default_rng(1).uniform(7.0, 10.0, mesh.n_cells)
    fine = build_model(mesh, young)
    coarse = build_model(mesh, young, make_coarsening("galerkin"))
    P = sp.kron(prolongation(blocks_from_mesh(mesh)), sp.identity(3))
    for fine_matrix, coarse_matrix in zip(assembled(fine), assembled(coarse), strict=True):
        projected = (P.T @ fine_matrix @ P).toarray()
        assert np.allclose(coarse_matrix.toarray(), projected, atol=1e-12 * np.abs(projected).max())


@pytest.mark.parametrize("method", ["average", "galerkin", "fit"])
def test_coarse_model_has_the_mass_of_the_fine_one(method):
    mesh = carved_box(7, 5, 4)
    young = np.full(mesh.n_cells, 1e9)
    fine, coarse = build_model(mesh, young), build_model(mesh, young, make_coarsening(method))
    assert coarse.mass == pytest.approx(fine.mass, rel=1e-12)
    _, M = assembled(coarse)
    translation = np.tile([1.0, 0.0, 0.0], coarse.mesh.n_nodes)
    assert translation @ (M @ translation) == pytest.approx(fine.mass, rel=1e-12)


def test_coarse_models_are_sound_where_cells_are_void():
    mesh = carved_box(7, 5, 5)
    young = 10.0 ** np.random.default_rng(2).uniform(7.0, 10.0, mesh.n_cells)
    K, M = assembled(build_model(mesh, young, make_coarsening("fit")))
    values = la.eigh(K.toarray(), M.toarray(), eigvals_only=True)
    assert np.abs(values[:6]).max() < 1e-9 * values[-1]
    assert values[6] > 1e-6 * values[-1]


def blocks_of_moduli(count=40):
    """Fine moduli (count, 8), some cells void."""
    random = np.random.default_rng(4)
    e = 10.0 ** random.uniform(8.0, 10.0, (count, 8))
    e[random.uniform(size=e.shape) < 0.2] = 0.0
    e[:, 0] = 1e9
    return e


@pytest.mark.parametrize("method", ["average", "galerkin", "ddfem"])
def test_derivatives_are_those_of_the_moduli_which_are_homogeneous(method):
    coarsening, e = make_coarsening(method), blocks_of_moduli()
    moduli, derivatives = coarsening.moduli_with_derivatives(e)
    assert np.array_equal(moduli, coarsening.moduli(e)) and (moduli > 0.0).all()
    assert np.allclose((derivatives @ e[:, :, None])[:, :, 0], moduli, rtol=1e-10)


@pytest.mark.parametrize("method", ["average", "galerkin"])
def test_linear_coarsenings_are_their_derivatives(method):
    coarsening, (first, second) = make_coarsening(method), np.split(blocks_of_moduli(), 2)
    _, derivatives = coarsening.moduli_with_derivatives(first)
    change = (derivatives @ (second - first)[:, :, None])[:, :, 0]
    assert np.allclose(coarsening.moduli(first) + change, coarsening.moduli(second), rtol=1e-10)


def test_fits_are_positive_and_refuse_derivatives_in_a_sentence():
    coarsening = make_coarsening("fit")
    assert (coarsening.moduli(blocks_of_moduli()) > 0.0).all()
    with pytest.raises(UserError, match="coarsening 'fit' has no derivatives; choose average"):
        coarsening.moduli_with_derivatives(blocks_of_moduli())


def test_coarsenings_are_made_by_name_and_tell_what_they_rest_on():
    assert make_coarsening("none") is None
    made = {method: make_coarsening(method) for method in METHODS if method != "none"}
    assert all(coarsening.name == method for method, coarsening in made.items())
    fractions = {method: coarsening.lumped_fraction for method, coarsening in made.items()}
    assert fractions["average"] == fractions["galerkin"] == 0.0
    assert fractions["fit"] == fractions["ddfem"] > 0.0
    assert made["average"].record() == {}
    assert made["fit"].record() == {"objective": "calibrated"}
    record = made["ddfem"].record()
    assert record["forest"] == "default" and record["forest_objective"] == "calibrated"
    assert len(record["forest_sha256"]) == 16
    with pytest.raises(UserError, match="coarsening 'cheese' is unknown, expected one of none"):
        make_coarsening("cheese")


@pytest.mark.parametrize("contrast", [0.0, 1.0])
def test_fitted_coarsening_beats_galerkin_and_average(contrast):
    mesh = solids.box_mesh(12, 8, 8)
    young = 1e9 * 10.0 ** (contrast * np.random.default_rng(3).uniform(-1.0, 1.0, mesh.n_cells))
    options = SolverOptions(method="slepc", modes=30, check_inertia=False)
    error = {}
    exact = modal_analysis(build_model(mesh, young), options, MPI.COMM_SELF).values[6:]
    for method in ("average", "galerkin", "fit"):
        model = build_model(mesh, young, make_coarsening(method))
        values = modal_analysis(model, options, MPI.COMM_SELF).values[6:]
        error[method] = np.sqrt(np.mean((np.sqrt(values / exact) - 1.0) ** 2))
    assert error["fit"] < 0.8 * error["galerkin"]
    assert error["galerkin"] <= error["average"] * (1.0 + 1e-9)
