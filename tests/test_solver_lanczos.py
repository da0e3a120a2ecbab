"""The block Lanczos iteration of the error correction, against LAPACK."""

import numpy as np
import pytest
from mpi4py import MPI

from carillon.errors import ConvergenceError
from carillon.fem.geometry import builtin_surface, hexmesh_from_voxels, voxelize
from carillon.fem.model import fine_model
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.options import SolverOptions
from solver.assembly.system import Layout, assemble
from solver.correction.error_correction import correct
from solver.correction.lanczos import lanczos, mixed
from solver.distribution.local_mesh import distribute
from solver.linear import Approximate, LinearSolver
from solver.subspace.rayleigh_ritz import rayleigh_ritz
from tests import solids

COMM = MPI.COMM_SELF


class Case:
    """A solid small enough for LAPACK, with a start block of random vectors."""

    def __init__(self, model, width):
        self.model = model
        local_mesh = distribute(model, 4, comm=COMM)
        layout = Layout.of_local_mesh(local_mesh, COMM)
        self.system = assemble(local_mesh, COMM, layout)
        self.inner = LinearSolver("multifrontal", layout)
        self.exact = solids.dense_eigenvalues(model)[6:]
        block = np.random.default_rng(3).standard_normal((model.n_dofs, width))
        # Once smoothed: a start that knows roughly where the spectrum lies.
        inverse = self.inner.inverse(self.system, -0.1 * self.exact[0])
        smoothed = inverse.solve(self.system.times_mass(block))
        self.values, self.start = rayleigh_ritz(self.system, smoothed)

    def run(self, shift, wanted, tolerance):
        """Lanczos around `shift`."""
        inverse = self.inner.inverse(self.system, shift)
        start, look = mixed(self.system, self.values, self.start, wanted, shift, tolerance)
        return lanczos(self.system, inverse, start, wanted, wanted + 10, tolerance, look)


@pytest.fixture(scope="module")
def box():
    """Box of random material."""
    return Case(solids.random_box(10, 6, 5), 90)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-5, 1e-9])
def test_wanted_modes_are_as_accurate_as_asked_and_orthonormal(box, tolerance):
    found = box.run(0.5 * box.exact[59], 60, tolerance)
    error = found.values[:60] / box.exact[:60] - 1.0
    assert -1e-10 < error.min() <= error.max() <= tolerance
    gram = box.system.inner(found.vectors, box.system.times_mass(found.vectors))
    assert np.abs(gram - np.eye(len(gram))).max() < 1e-9
    rigid = box.system.inner(box.system.times_mass(box.system.rigid), found.vectors)
    assert np.abs(rigid).max() < 1e-9
    stiff = box.system.inner(found.vectors, box.system.times_stiffness(found.vectors))
    assert np.abs(stiff / found.values - np.eye(len(stiff))).max() < 1e-6


@pytest.mark.parametrize("distance", [1e-3, 1e-5])
def test_a_shift_near_an_eigenvalue_does_no_harm(box, distance):
    found = box.run(box.exact[25] * (1.0 + distance), 60, 1e-8)
    assert not found.resonant
    assert np.abs(found.values[:60] / box.exact[:60] - 1.0).max() < 1e-8
    gram = box.system.inner(found.vectors, box.system.times_mass(found.vectors))
    assert np.abs(gram - np.eye(len(gram))).max() < 1e-9


def test_a_shift_on_an_eigenvalue_is_moved(box, monkeypatch):
    on_it = box.exact[25] * (1.0 + 1e-12)
    assert box.run(on_it, 60, 1e-8).resonant
    monkeypatch.setattr(
        "solver.correction.subspace_iteration.SHIFT_FRACTION", on_it / box.values[59]
    )
    result = correct(box.system, box.start, 60, box.inner, box.values, tolerance=1e-8)
    assert np.abs(result.values / box.exact[:60] - 1.0).max() <= 1e-8


def test_repeated_eigenvalues_are_all_found():
    cube = Case(solids.uniform_box(7, 7, 7, 0.01), 80)
    # The symmetry of the cube makes two and three modes of most.
    assert (np.diff(cube.exact[:50]) < 1e-9 * cube.exact[:49]).sum() > 20
    found = cube.run(0.5 * cube.exact[49], 50, 1e-9)
    assert np.abs(found.values[:50] / cube.exact[:50] - 1.0).max() < 1e-9


def test_the_whole_space_is_exhausted():
    small = Case(solids.random_box(3, 2, 2), 45)
    found = small.run(0.5 * small.exact[39], 40, 1e-12)
    assert np.abs(found.values[:40] / small.exact[:40] - 1.0).max() < 1e-10


def test_a_start_far_too_stiff_moves_the_shift(box):
    rough = np.random.default_rng(5).standard_normal((box.model.n_dofs, 80))
    values, start = rayleigh_ritz(box.system, rough)
    assert values[59] > 3.0 * box.exact[59]
    result = correct(box.system, start, 60, box.inner, values, tolerance=1e-7)
    assert np.abs(result.values / box.exact[:60] - 1.0).max() <= 1e-7
    assert result.errors.max() <= 1e-7


def test_a_mode_that_the_iteration_misses_is_noticed_and_found(box, monkeypatch):
    def one_missing(*arguments):
        found = lanczos(*arguments)
        found.values, found.vectors = np.delete(found.values, 3), np.delete(found.vectors, 3, 1)
        return found

    start = box.run(0.5 * box.exact[59], 60, 1e-2)
    monkeypatch.setattr("solver.correction.subspace_iteration.lanczos", one_missing)
    result = correct(box.system, start.vectors, 60, box.inner, start.values, tolerance=1e-6)
    assert np.abs(result.values / box.exact[:60] - 1.0).max() <= 1e-6


def test_warm_start_takes_the_inverse_of_the_material_before():
    model = solids.random_box(10, 7, 6)
    prepared = ModalSolver(model, SolverOptions(modes=40, tolerance=1e-3), COMM)
    first = prepared.solve()
    young = model.young * (1.0 + 0.02 * np.cos(np.arange(len(model.young))))[:, None]
    warm = prepared.solve(young, initial_modes=first)
    exact = solids.dense_eigenvalues(model.with_young(young))[6:40]
    error = np.abs(warm.values[6:] / exact - 1.0)
    assert error.max() <= 1e-3
    assert np.median(error) <= 1e-4
    # Nothing was factorised, and what does not depend on the moduli was not assembled again.
    assert warm.inverse is first.inverse
    assert warm.system.rows.mass is first.system.rows.mass
    other = ModalSolver(model, SolverOptions(modes=40, tolerance=1e-3), COMM)
    assert other.solve(young, initial_modes=first).inverse is not first.inverse


def test_an_inverse_is_scaled_to_a_similar_stiffness():
    """Exactly, where all moduli differ by one factor and the right-hand sides are free of M X."""
    model = solids.random_box(6, 5, 4)
    prepared = ModalSolver(model, SolverOptions(modes=20, tolerance=1e-9), COMM)
    modes = prepared.solve()
    other = prepared.solve(1.7 * model.young)
    shift = 0.5 * modes.values[-1]
    similar = prepared.inverse(modes, shift)
    system, vectors = other.system, other.vectors
    mass_vectors = system.times_mass(vectors)
    diagonal = system.rows.stiffness_diagonal
    np.testing.assert_allclose(diagonal, 1.7 * modes.system.rows.stiffness_diagonal)
    block = np.random.default_rng(0).standard_normal((system.n_dofs, 3))
    block -= mass_vectors @ (vectors.T @ block)
    found = Approximate(similar, system, vectors, mass_vectors).solve(block)
    expected = prepared.inverse(other, 1.7 * shift).solve(block)
    np.testing.assert_allclose(found, expected, atol=1e-9 * np.abs(expected).max())


def test_one_step_follows_a_material_that_changes_smoothly():
    model = solids.random_box(10, 7, 6)
    prepared = ModalSolver(model, SolverOptions(modes=36, tolerance=1e-3), COMM)
    first = prepared.solve()
    young = model.young * (1.0 + 0.1 * np.cos(0.3 * model.mesh.grid[:, 0]))[:, None]
    warm = prepared.solve(young, initial_modes=first)
    assert warm.evidence["corrections"] == 1 and warm.evidence["right_hand_sides"] == 30
    exact = solids.dense_eigenvalues(model.with_young(young))[6:36]
    assert np.abs(warm.values[6:] / exact - 1.0).max() <= 1e-4


@pytest.mark.parametrize("method", ["lanczos", "hcms"])
def test_modes_too_far_off_to_be_corrected_are_sought_anew(method, capfd):
    """From a stiff core to a soft layer of a box: modes of many symmetries change their places."""
    mesh = hexmesh_from_voxels(voxelize(builtin_surface("box"), 8))
    place = np.abs(2.0 * mesh.grid / mesh.grid.max(axis=0) - 1.0)
    core = np.where(place.max(axis=1) < 0.6, 1e11, 1e7)
    layer = np.where(place[:, 0] < 0.5, 1e7, 1e11)
    model = fine_model(mesh, core)
    prepared = ModalSolver(model, SolverOptions(modes=20, tolerance=1e-9, method=method), COMM)
    cold = prepared.solve(layer)
    far = prepared.solve(layer, initial_modes=prepared.solve())
    assert "modes are sought anew" in capfd.readouterr().err
    np.testing.assert_allclose(far.values[6:], cold.values[6:], rtol=1e-8)


@pytest.mark.parametrize(("change", "kept"), [(0.05, True), (0.4, False)])
def test_a_similar_inverse_does_for_as_long_as_it_gets_on(change, kept):
    """However far the material is, the result is as accurate as from anywhere else."""
    model = solids.random_box(10, 7, 6)
    prepared = ModalSolver(model, SolverOptions(modes=36, tolerance=1e-3), COMM)
    first = last = prepared.solve()
    for step in range(1, 5):
        wave = np.cos(0.1 * step * np.arange(len(model.young)))
        young = model.young * (1.0 + change * wave)[:, None]
        last = prepared.solve(young, initial_modes=last)
        exact = solids.dense_eigenvalues(model.with_young(young))[6:36]
        error = np.abs(last.values[6:] / exact - 1.0)
        assert error.max() <= 1e-3
        assert np.median(error) <= 1e-4
    assert (last.inverse is first.inverse) == kept


def test_a_contrast_of_a_million_and_nearly_void_elements_are_solved():
    mesh = solids.box_mesh(9, 5, 4)
    exact_model = fine_model(mesh, np.where(np.arange(mesh.n_cells) % 9 < 5, 1e10, 1e4))
    exact = solids.dense_eigenvalues(exact_model)[6:40]
    found = solids.analysed(exact_model, modes=40, tolerance=1e-6)
    assert np.abs(found.values[6:] / exact - 1.0).max() <= 1e-6


def test_a_nearly_void_cell_is_solved_and_a_cut_through_the_body_refused():
    mesh = solids.box_mesh(9, 5, 4)
    young = np.full(mesh.n_cells, 1e9)
    young[0] = 1.0
    model = fine_model(mesh, young)
    exact = solids.dense_eigenvalues(model)[6:40]
    options = SolverOptions(modes=40, tolerance=1e-6)
    found = ModalSolver(model, options, COMM).solve()
    assert np.abs(found.values[6:] / exact - 1.0).max() <= 1e-6
    across = mesh.nodes[mesh.cells].mean(axis=1)[:, 0]
    apart = fine_model(mesh, np.where(np.abs(across - across.mean()) < 0.006, 1.0, 1e9))
    with pytest.raises(ConvergenceError, match="zero-frequency modes found, .* has 6"):
        ModalSolver(apart, options, COMM).solve()


@pytest.mark.parametrize("modes", [30, 60])
def test_materials_that_move_far_from_the_first_are_followed(modes):
    """The inverse of the first material serves as long as it gets on; then it is made anew."""
    model = solids.random_box(16, 8, 6)
    solver = ModalSolver(model, SolverOptions(modes=modes, tolerance=1e-2))
    found = None
    for step in range(6):
        young = np.full(model.mesh.n_cells, 1e9)
        young[: len(young) // 5] *= 1.5**step
        found = solver.solve(young, initial_modes=found)
    cold = ModalSolver(model, SolverOptions(modes=modes, tolerance=1e-9)).solve(young)
    np.testing.assert_allclose(found.values[6:], cold.values[6:], rtol=1e-2)
