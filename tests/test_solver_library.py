"""The solver called from Python, and starts from earlier results."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

import solver
from carillon.errors import UserError
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.options import SolverOptions
from solver.verification.comparison import compare_files
from tests import solids
from tests.rank_counts import TO_THREE

COMM = MPI.COMM_SELF
BAR = ("builtin:bar", "--resolution", "16")
MODES = ("--modes", "30")


def test_solve_takes_and_returns_arrays():
    model = solids.random_box(8, 5, 4)
    exact = solids.dense_eigenvalues(model)[6:30]
    found = solver.solve(model.mesh, model.young[:, 0], modes=30, comm=COMM, tolerance=1e-9)
    assert np.abs(found.eigenvalues[6:] / exact - 1.0).max() < 1e-9
    assert found.modes.shape == (model.n_dofs, 30)
    assert np.allclose(found.frequencies, np.sqrt(found.eigenvalues) / (2.0 * np.pi))
    assert found.evidence["rigid_modes"] == 6


def test_warm_start_reaches_the_same_modes_with_fewer_solves():
    model = solids.random_box(10, 7, 6)
    prepared = ModalSolver(model, SolverOptions(modes=40, tolerance=1e-6), COMM)
    first = prepared.solve()
    young = model.young * (1.0 + 0.02 * np.sin(np.arange(len(model.young))))[:, None]
    cold, warm = prepared.solve(young), prepared.solve(young, initial_modes=first)
    exact = solids.dense_eigenvalues(model.with_young(young))[6:40]
    for found in (cold, warm):
        assert np.abs(found.values[6:] / exact - 1.0).max() < 1e-6
    assert warm.evidence["right_hand_sides"] < cold.evidence["right_hand_sides"]
    assert "lanczos" in cold.seconds
    assert "lanczos" not in warm.seconds


@pytest.mark.parametrize(
    ("material", "sentence"),
    [
        (np.ones(3), r"shape \(3,\), expected \(12,\) or \(12, 8\)"),
        (np.full(12, -1.0), "moduli: 12 values are negative"),
        (np.full(12, np.nan), "moduli: 12 values are not finite"),
        (np.zeros((12, 8)), "moduli: all 96 values are zero"),
        (np.r_[0.0, np.ones(11)], "moduli: 1 voxels have modulus zero"),
        (np.full(12, 1e20), r"expected 0.001 to 1e\+15 Pa"),
        (np.full(12, 1.0 + 1.0j), "an array of complex128, expected real numbers"),
        (None, "a mesh has no material"),
        ("cheese", "cheese"),
    ],
)
def test_material_that_does_not_fit_is_refused(material, sentence):
    with pytest.raises(UserError, match=sentence):
        solver.solve(solids.box_mesh(3, 2, 2), material, modes=10, comm=COMM)
    if isinstance(material, np.ndarray):
        prepared = ModalSolver(solids.random_box(3, 2, 2), SolverOptions(modes=10), COMM)
        with pytest.raises(UserError, match=sentence):
            prepared.solve(material)


def test_moduli_of_cells_are_those_of_all_their_points():
    model = solids.random_box(4, 3, 3)
    prepared = ModalSolver(model, SolverOptions(modes=20), COMM)
    cells = prepared.solve(2.0 * model.young[:, 0])
    assert np.array_equal(cells.values, prepared.solve(2.0 * model.young).values)


def test_coarse_moduli_may_be_zero_but_not_negative():
    model = solids.random_box(4, 3, 3)
    prepared = ModalSolver(model, SolverOptions(modes=20), COMM)
    moduli = model.young.copy()
    moduli[0, :2] = 0.0
    exact = solids.dense_eigenvalues(replace(model, young=moduli))[6:20]
    assert np.abs(prepared.solve(moduli, coarsened=True).values[6:] / exact - 1.0).max() < 1e-5
    for wrong, sentence in ((-moduli, "are negative"), (moduli[:, 0], r"expected \(36, 8\)")):
        with pytest.raises(UserError, match=f"coarse moduli: .*{sentence}"):
            prepared.solve(wrong, coarsened=True)


@pytest.mark.mpi
@pytest.mark.parametrize("ranks", TO_THREE)
def test_command_starts_from_a_file_on_any_number_of_ranks(ranks, tmp_path, run_cli, mpiexec):
    before, after, truth = (tmp_path / f"{name}.h5" for name in ("before", "after", "truth"))
    run_cli("solver", "modes", *BAR, "--material", "uniform", *MODES, "--out", before, check=True)
    smooth = (*BAR, "--material", "smooth", *MODES)
    run_cli("solver", "modes", *smooth, "--method", "slepc", "--out", truth, check=True)
    options = ("--initial-modes", before, "--out", after, "--tolerance", "1e-8")
    mpiexec(ranks, "solver", "modes", *smooth, *options, check=True)
    assert compare_files(after, truth).eigenvalue_relative_error["max"] < 1e-8


def test_unsuitable_start_is_refused(tmp_path, run_cli):
    few, other = tmp_path / "few.h5", tmp_path / "other.h5"
    run_cli("solver", "modes", *BAR, "--modes", "10", "--out", few, check=True)
    run_cli(
        "solver", "modes", "builtin:bar", "--resolution", "12", "--out", other, *MODES, check=True
    )
    for start, sentence in ((few, "holds 10 modes, 30 are wanted"), (other, "another mesh")):
        out = tmp_path / "x.h5"
        done = run_cli("solver", "modes", *BAR, *MODES, "--initial-modes", start, "--out", out)
        assert done.returncode == 2
        assert sentence in done.stderr
        assert not out.exists()


def test_petsc_options_reach_slepc_and_strangers_are_refused(tmp_path, run_cli):
    out = tmp_path / "x.h5"
    method = ("--method", "slepc", "--out", out)
    done = run_cli(
        "solver", "modes", *BAR, *MODES, *method, "--petsc=-carillon_eps_ncv 90 -carillon_eps_view"
    )
    assert done.returncode == 0
    assert "maximum dimension of the subspace (ncv): 90" in " ".join(done.stdout.split()).replace(
        "column vectors (ncv)", "maximum dimension of the subspace (ncv)"
    )
    done = run_cli("solver", "modes", *BAR, *MODES, *method, "--petsc=-eps_ncv 90")
    assert done.returncode == 2
    assert "-carillon_eps_ncv" in done.stderr


def test_ghost_of_an_eigenvalue_is_proven_absent_for_corrected_modes():
    model = solids.random_box(8, 5, 4)
    evidence = solids.analysed(model, modes=30, check_inertia=True, tolerance=1e-9).evidence
    assert evidence["inertia_count"] == evidence["inertia_expected"] >= 30
