"""Modes from random vectors: expected eigenvalues, the shift, both iterations, the proof."""

import json

import numpy as np
import pytest
from mpi4py import MPI

from carillon.errors import ConvergenceError, UserError
from carillon.fem.geometry import blocks_from_mesh, builtin_surface, hexmesh_from_voxels, voxelize
from carillon.fem.materials import young_modulus
from carillon.fem.model import RIGID_MODES, fine_model
from solver.analysis import corrected
from solver.analysis.coarse_start import coarse_start
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.options import SolverOptions
from solver.assembly.system import Layout, assemble
from solver.coarsening.choice import make_coarsening
from solver.correction.lanczos import mixed
from solver.correction.lobpcg import lobpcg
from solver.correction.shift import LEAST, MOST, inverse_amid
from solver.correction.trial_space import TrialSpace
from solver.distribution.local_mesh import distribute
from solver.linear import LinearSolver, rank_tree
from solver.linear.factorisation import count_negative
from solver.subspace.basis import BlockBasis
from solver.subspace.start import start_block
from solver.subspace.weyl import CountingLaw
from tests import solids

COMM = MPI.COMM_SELF
SOLIDS = {"bell": 14, "plate": 20, "bar": 20, "box": 8}
FACTOR = 4.0
"""How far expected eigenvalues may be off, above or below."""


def built_in(name, material="uniform"):
    """Model of a built-in object."""
    mesh = hexmesh_from_voxels(voxelize(builtin_surface(name), SOLIDS[name]))
    return fine_model(mesh, young_modulus(material, mesh, 0))


class Case:
    """A model assembled on this rank, and its elastic eigenvalues by LAPACK."""

    def __init__(self, model, linear_solver="multifrontal"):
        local_mesh = distribute(model, 1, comm=COMM)
        layout = Layout.of_local_mesh(local_mesh, COMM)
        self.model = model
        self.system = assemble(local_mesh, COMM, layout)
        self.linear = LinearSolver(linear_solver, layout)
        self.exact = solids.dense_eigenvalues(model)[RIGID_MODES:]


@pytest.fixture(scope="module")
def box():
    """Box of random material."""
    return Case(solids.random_box(9, 6, 5))


@pytest.mark.parametrize("name", SOLIDS)
@pytest.mark.parametrize("material", ["uniform", "two-region", "random"])
def test_eigenvalues_lie_about_where_they_are_expected(name, material):
    model = built_in(name, material)
    found = solids.analysed(model, modes=100, tolerance=1e-3).values
    for number in (30, 99):
        expected = CountingLaw.of_solid(model, model.young, number).eigenvalue(number)
        assert 1.0 / FACTOR < expected / found[number] < FACTOR


def test_the_law_scales_as_a_spectrum_does():
    law = CountingLaw((1e-9, 1e-5, 1e-2))
    values = [law.eigenvalue(number) for number in (1, 10, 100)]
    assert values == sorted(values)
    model = solids.uniform_box(6, 5, 4, 0.01)
    once = CountingLaw.of_solid(model, model.young, 20).eigenvalue(20)
    stiffer = CountingLaw.of_solid(model, 4.0 * model.young, 20).eigenvalue(20)
    larger = solids.uniform_box(6, 5, 4, 0.02)
    assert stiffer == pytest.approx(4.0 * once)
    assert CountingLaw.of_solid(larger, larger.young, 20).eigenvalue(20) == pytest.approx(once / 4)


@pytest.mark.parametrize("wrong", [0.1, 1.0, 10.0])
def test_the_shift_gets_among_the_wanted_eigenvalues_however_wrong_the_law(box, wrong):
    terms = CountingLaw.of_solid(box.model, box.model.young, 60).terms
    law = CountingLaw(tuple(term / wrong for term in terms))
    inverse = inverse_amid(box.system, box.linear, 60, law)
    below = int((box.exact < inverse.shift).sum())
    assert inverse.negative == RIGID_MODES + below
    assert LEAST * 60 <= below <= MOST * 60


@pytest.mark.parametrize("share", [0.02, 0.3, 0.9])
def test_inertia_counts_eigenvalues_with_and_without_a_factor_to_keep(box, share):
    value = float(box.exact[int(share * len(box.exact))]) * (1.0 + 1e-6)
    expected = RIGID_MODES + int((box.exact < value).sum())
    assert box.linear.inverse(box.system, value).negative == expected
    assert box.linear.count_below(box.system, value) == expected
    assert count_negative(box.system.K, box.system.M, value) == expected


@pytest.mark.parametrize("method", ["lanczos", "lobpcg"])
@pytest.mark.parametrize("tolerance", [1e-2, 1e-6])
def test_modes_are_as_accurate_as_asked_and_proven(box, method, tolerance):
    found = solids.analysed(
        box.model, modes=46, tolerance=tolerance, method=method, check_inertia=True
    )
    error = found.values[RIGID_MODES:] / box.exact[:40] - 1.0
    assert -1e-9 < error.min() <= error.max() <= tolerance
    assert found.evidence["method"] == method
    assert found.evidence["inertia_count"] == found.evidence["inertia_expected"]
    assert found.evidence["eigenvalue_error_estimate"] <= tolerance


def test_symmetric_solids_keep_all_copies():
    cube = Case(solids.uniform_box(7, 7, 7, 0.01))
    found = solids.analysed(cube.model, modes=60, tolerance=1e-8)
    assert np.abs(found.values[RIGID_MODES:] / cube.exact[:54] - 1.0).max() <= 1e-8


def test_conjugate_gradients_end_where_they_no_longer_get_on(box):
    start = start_block(box.system, 20, 0)
    # Next to nothing from a preconditioner must not look like an error of next to nothing.
    with pytest.raises(ConvergenceError, match="conjugate gradients stagnate .* 1.0e-06"):
        lobpcg(box.system, lambda block: 1e-20 * np.sin(block), start, 10, 1e-6, 200)
    with pytest.raises(ConvergenceError, match="spans 20 elastic modes, 30 are wanted"):
        lobpcg(box.system, np.array, start, 30, 1e-6, 200)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("modes", [20, 40, 60, 90, 130, 143, 144])
@pytest.mark.parametrize("inertia", [False, True])
def test_conjugate_gradients_find_nearly_all_modes_of_a_tiny_solid(modes, inertia):
    tiny = Case(solids.uniform_box(5, 2, 1, 0.01, 1e9))
    assert tiny.system.n_dofs == 108
    modes = min(modes, 108)
    found = solids.analysed(tiny.model, modes=modes, method="lobpcg", check_inertia=inertia)
    expected = tiny.exact[: modes - RIGID_MODES]
    np.testing.assert_allclose(found.values[RIGID_MODES:], expected, rtol=1e-7)


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("columns", [1, 6, 24, 37])
def test_blocks_of_a_basis_are_one_matrix(box, threads, columns):
    box.system.rows.threads = threads
    rng = np.random.default_rng(columns)
    rows = box.system.n_dofs
    basis = BlockBasis(box.system, 24, 3)
    parts = [rng.standard_normal((rows, width)) for width in (24, 6, 17)]
    for part in parts:
        basis.append(part)
    whole = np.concatenate(parts, axis=1)
    vectors = rng.standard_normal((rows, columns))
    overlap = basis.inner(vectors)
    np.testing.assert_allclose(overlap, whole.T @ vectors, atol=1e-9)
    rest = vectors.copy()
    basis.remove(overlap, rest)
    np.testing.assert_allclose(rest, vectors - whole @ overlap, atol=1e-7)
    weights = rng.standard_normal((basis.size, columns))
    of_rest = rng.standard_normal((columns, columns))
    combined = basis.combine(weights, rest, of_rest)
    np.testing.assert_allclose(combined, whole @ weights + rest @ of_rest, atol=1e-7)
    box.system.rows.threads = 1


def test_what_no_memory_holds_is_left_to_multigrid(box, monkeypatch):
    monkeypatch.setattr(rank_tree, "available_memory", lambda: 1000)
    found = solids.analysed(box.model, modes=26, tolerance=1e-4)
    assert (found.evidence["method"], found.evidence["linear_solver"]) == ("lobpcg", "amg-cg")
    assert np.abs(found.values[RIGID_MODES:] / box.exact[:20] - 1.0).max() <= 1e-4


@pytest.mark.parametrize("method", ["lobpcg", "hcms"])
def test_a_count_that_no_memory_holds_is_refused_before_modes_are_sought(box, monkeypatch, method):
    def never(*_, **__):
        raise AssertionError("modes are sought")

    monkeypatch.setattr(corrected, "correct", never)
    monkeypatch.setattr(rank_tree, "available_memory", lambda: 1000)
    options = {"modes": 26, "tolerance": 1e-4, "method": method, "check_inertia": True}
    with pytest.raises(UserError, match="count of eigenvalues takes about .* leave out"):
        solids.analysed(box.model, **options)
    monkeypatch.setattr(rank_tree, "available_memory", lambda: None)
    with pytest.raises(AssertionError, match="modes are sought"):
        solids.analysed(box.model, **options)


@pytest.mark.parametrize(
    ("given", "complaint"),
    [
        ({"method": "lanczos", "corrections": 0}, "lanczos has no use for --corrections 0"),
        ({"method": "lobpcg", "subdomains": 4}, "lobpcg has no use for --subdomains"),
        ({"method": "lanczos", "linear_solver": "amg-cg"}, "amg-cg; use lobpcg"),
        ({"method": "lobpcg", "linear_solver": "mumps"}, "mumps; use lanczos"),
    ],
)
def test_options_of_other_methods_are_refused(box, given, complaint):
    with pytest.raises(UserError, match=complaint):
        ModalSolver(box.model, SolverOptions(modes=20, **given), COMM)


def test_what_rounding_has_left_in_the_space_of_gradients_is_taken_out(box):
    system = box.system
    space = TrialSpace(system, start_block(system, 14, 0))
    exact, off = space.values, np.eye(14) + 1e-6 * np.ones((14, 14))
    space._block[:, :14] = (
        space._block[:, :14] @ off
    )  # as steps do where vectors are near dependent
    vectors = space.vectors()
    np.testing.assert_allclose(system.project_mass(vectors, vectors), np.eye(14), atol=1e-12)
    np.testing.assert_allclose(space.values, exact, rtol=1e-12)


@pytest.mark.parametrize("method", ["lanczos", "lobpcg", "hcms"])
def test_coarse_modes_are_a_start(method):
    model = built_in("bell", "smooth")
    options = SolverOptions(modes=46, tolerance=1e-6, method=method)
    solver = ModalSolver(model, options, COMM)
    start = coarse_start(solver, model, make_coarsening("galerkin"))
    coarse = blocks_from_mesh(model.mesh).coarse.n_nodes
    assert start.vectors().shape[0] == model.n_dofs > 3 * coarse
    found = solver.solve(initial_modes=start)
    cold = ModalSolver(model, options, COMM).solve()
    np.testing.assert_allclose(found.values[6:], cold.values[6:], rtol=1e-6)
    assert found.evidence["right_hand_sides"] <= cold.evidence["right_hand_sides"]


def test_no_column_vanishes_where_the_shift_is_a_value_of_the_start(box):
    values, vectors = np.arange(1.0, 15.0), start_block(box.system, 14, 0)
    block, _ = mixed(box.system, values, vectors, 14, values[7], 1e-3, columns=8)
    assert np.linalg.cond(block) < 1e6


def test_a_coarsened_model_has_nothing_to_start_from(run_cli, tmp_path):
    out = tmp_path / "modes.h5"
    command = ["modes", "builtin:bar", "--resolution", 12, "--modes", 12, "--out", out, "--refine"]
    done = run_cli("solver", *command, "--coarsen", "ddfem")
    assert done.returncode == 2 and "expected voxels, --coarsen none" in done.stderr
    done = run_cli("solver", *command, "--initial-modes", tmp_path / "other.h5")
    assert done.returncode == 2 and "leave out --initial-modes" in done.stderr
    assert not out.exists()


def test_a_start_from_the_coarse_solid_goes_with_an_estimate(run_cli, tmp_path):
    command = ["modes", "builtin:bar", "--resolution", 12, "--modes", 12, "--estimate", "--refine"]
    done = run_cli("solver", *command, "--out", tmp_path / "modes.h5", check=True)
    assert "expected distance from the solid" in done.stdout


@pytest.mark.mpi
@pytest.mark.parametrize("method", ["lanczos", pytest.param("lobpcg", marks=pytest.mark.nightly)])
def test_any_number_of_ranks_finds_the_same(method, run_cli, mpiexec, tmp_path):
    out = tmp_path / "modes.h5"
    command = ["modes", "builtin:bell", "--resolution", 12, "--modes", 40, "--tolerance", "1e-8"]
    command += ["--method", method, "--refine", "--no-estimate", "--json", "--out", out]
    spectra = []
    alone = run_cli("solver", *command, check=True)
    for done in (alone, *(mpiexec(ranks, "solver", *command, check=True) for ranks in (2, 3))):
        spectra.append(json.loads(done.stdout)["frequencies_hz"][RIGID_MODES:])
    np.testing.assert_allclose(spectra[1:], [spectra[0]] * 2, rtol=1e-8)
