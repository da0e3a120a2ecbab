"""What a spectrum must satisfy, whatever computed it."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg as la
import scipy.sparse as sp
from mpi4py import MPI

from carillon.errors import ConvergenceError, UserError
from carillon.fem.block import degrees_of_freedom
from carillon.fem.element import rigid_motions
from carillon.fem.model import RIGID_MODES, fine_model
from solver.analysis.modal_solver import modal_analysis
from solver.analysis.options import SolverOptions
from solver.assembly.sparse import assembled
from solver.assembly.system import Layout, assemble
from solver.correction.error_correction import correct
from solver.distribution.local_mesh import distribute
from solver.hcms.condense import restrict_stiffness
from solver.hcms.synthesis import synthesize
from solver.linear import LinearSolver, iterative
from solver.subspace.weyl import clusters
from solver.verification.matching import subspace_angles
from studies.accuracy import domains
from studies.accuracy.ritz import free_eigenvalues
from tests import solids

COMM = MPI.COMM_SELF
POISSON = 0.25
DENSITY = 1000.0


def spectrum(model, **options) -> np.ndarray:
    """Eigenvalues by `modal_analysis` on one rank."""
    return solids.analysed(model, **options).values


@pytest.mark.parametrize("lumped", [False, True])
def test_ritz_values_bound_the_spectrum_and_fall_with_more_modes(lumped):
    model = solids.random_box(8, 5, 3, lumped=lumped)
    exact = solids.dense_eigenvalues(model)
    local_mesh = distribute(model, 5, comm=COMM)
    before = np.full(40, np.inf)
    for keep in (60, 110, 200):
        values = synthesize(local_mesh, keep, "free", COMM).values[:40]
        slack = 1e-9 * exact[40]
        assert (values >= exact[:40] - slack).all()
        assert (values <= before + slack).all()
        before = values


@pytest.mark.parametrize("interface", ["overlapping", "free", "fixed"])
@pytest.mark.parametrize("subdomains", [1, 2, 5])
@pytest.mark.parametrize("lumped", [False, True])
def test_all_modes_kept_equal_the_full_solve(interface, subdomains, lumped):
    model = solids.random_box(6, 4, 3, lumped=lumped)
    exact = solids.dense_eigenvalues(model)
    local_mesh = distribute(model, subdomains, comm=COMM)
    result = synthesize(local_mesh, 10**6, interface, COMM)
    # The eigenvalues of a backward stable solver are off by rounding of the largest one.
    assert np.abs(result.values - exact).max() <= 1e-12 * exact[-1]
    K, M = assembled(model)
    order = degrees_of_freedom(local_mesh.nodes)
    vectors = np.empty_like(result.vectors)
    vectors[order] = result.vectors
    gram = vectors.T @ (M @ vectors)
    assert np.abs(gram - np.eye(len(gram))).max() < 1e-10
    residual = K @ vectors - (M @ vectors) * result.values
    assert np.abs(residual).max() < 1e-11 * np.abs(K).max() * np.abs(vectors).max()


def test_element_restricted_to_its_nodes_relaxes_or_holds_the_others():
    elements = fine_model(solids.box_mesh(1, 1, 1), np.array([1e9])).elements
    element, places = elements.stiffness(), elements.node_places
    everything = np.ones((1, 8), dtype=bool)
    for interface in ("free", "fixed"):
        assert np.allclose(restrict_stiffness(element, everything, interface, places), element)
    for code in range(1, 255):
        inside = np.array([[code >> corner & 1 for corner in range(8)]], dtype=bool)
        relaxed = restrict_stiffness(element, inside, "free", places)[0]
        held = restrict_stiffness(element, inside, "fixed", places)[0]
        scale = np.abs(element).max()
        assert la.eigvalsh(relaxed)[0] > -1e-12 * scale
        assert la.eigvalsh(held - relaxed)[0] > -1e-12 * scale
        # Relaxed: free-standing, so rigid motions of the kept nodes cost nothing.
        nodes = np.where(inside[0][:, None], solids.box_mesh(1, 1, 1).nodes, 0.0)
        motion = np.repeat(inside[0], 3)[:, None] * rigid_motions(nodes)
        assert np.abs(relaxed @ motion).max() < 1e-9 * scale * np.abs(motion).max()


@pytest.mark.parametrize("interface", ["overlapping", "free", "fixed"])
@pytest.mark.parametrize("acceleration", ["lanczos", "krylov", "relaxation"])
def test_corrected_modes_are_as_accurate_as_the_solver_says(interface, acceleration):
    model = solids.random_box(12, 6, 5)
    exact = solids.dense_eigenvalues(model)[:60]
    result = solids.analysed(
        model,
        modes=60,
        interface=interface,
        acceleration=acceleration,
        subdomains=6,
        retained_modes=110,
    )
    assert np.abs(result.values[6:] / exact[6:] - 1.0).max() <= 1e-7
    assert result.evidence["eigenvalue_error_estimate"] <= 1e-7
    assert result.evidence["rigid_modes"] == RIGID_MODES
    assert result.evidence["orthogonality"] < 1e-10


@pytest.mark.parametrize("acceleration", ["krylov", "relaxation"])
def test_error_estimate_follows_the_true_error(acceleration):
    model = solids.random_box(12, 6, 5)
    exact = solids.dense_eigenvalues(model)
    local_mesh = distribute(model, 6, comm=COMM)
    system = assemble(local_mesh, COMM)
    start = synthesize(local_mesh, 110, "free", COMM).vectors
    steps = {}
    result = correct(
        system,
        start,
        50,
        LinearSolver("multifrontal", Layout.of_local_mesh(local_mesh, COMM)),
        tolerance=0.0,
        max_steps=3,
        acceleration=acceleration,
        observe=lambda step, values: steps.update({step: values}),
    )
    for step, estimate in enumerate(result.history):
        true = (steps[step] / exact[6:56] - 1.0).max()
        assert true <= estimate <= 100.0 * true


@pytest.mark.parametrize("acceleration", ["krylov", "relaxation"])
def test_a_missed_tolerance_may_be_kept_and_is_told(acceleration):
    model = solids.random_box(12, 6, 5)
    exact = solids.dense_eigenvalues(model)[6:60]
    options = SolverOptions(
        modes=60, tolerance=1e-12, corrections=1, acceleration=acceleration, subdomains=6
    )
    with pytest.raises(ConvergenceError, match=r"after 1 steps, 1\.0e-12 was asked for"):
        modal_analysis(model, options, COMM)
    kept = modal_analysis(model, replace(options, missed_tolerance="keep"), COMM)
    told = kept.evidence["eigenvalue_error_estimate"]
    assert kept.evidence["missed_tolerance"] == 1e-12 < told
    # Ritz values, which bound the eigenvalues from above, as near as is told.
    error = kept.values[6:] / exact - 1.0
    assert (error >= -1e-12).all() and error.max() <= told
    enough = replace(options, missed_tolerance="keep", tolerance=1e-2, corrections=40)
    assert "missed_tolerance" not in modal_analysis(model, enough, COMM).evidence


def test_what_a_failing_linear_solver_leaves_may_be_kept(monkeypatch):
    model = solids.random_box(12, 6, 5)
    options = SolverOptions(modes=60, acceleration="relaxation", linear_solver="icc-pcg")

    def stopped(self, block):
        raise ConvergenceError("icc-pcg stopped")

    monkeypatch.setattr(iterative.IterativeInverse, "solve", stopped)
    with pytest.raises(ConvergenceError, match="icc-pcg stopped"):
        modal_analysis(model, options, COMM)
    kept = modal_analysis(model, replace(options, missed_tolerance="keep"), COMM).evidence
    assert kept["corrections"] == 0 and kept["eigenvalue_error_estimate"] > 1e-7


def test_correction_that_misses_its_tolerance_says_so():
    model = solids.random_box(12, 6, 5)
    with pytest.raises(ConvergenceError, match="eigenvalue error of .* was asked for"):
        spectrum(
            model, modes=60, corrections=1, tolerance=1e-12, subdomains=6, acceleration="krylov"
        )


def test_spectrum_scales_exactly_with_modulus_and_size():
    base = solids.random_box(7, 4, 4)
    values = spectrum(base, modes=40, tolerance=1e-12)
    stiffer = fine_model(base.mesh, 4.0 * base.young[:, 0])
    assert np.allclose(
        spectrum(stiffer, modes=40, tolerance=1e-12)[6:], 4.0 * values[6:], rtol=1e-9
    )
    larger = fine_model(solids.box_mesh(7, 4, 4, edge=0.02), base.young[:, 0])
    # Frequencies go with 1 / size, eigenvalues with its square.
    assert np.allclose(spectrum(larger, modes=40, tolerance=1e-12)[6:], values[6:] / 4.0, rtol=1e-9)


@pytest.mark.parametrize("profile", [np.ones_like, lambda x: (1.0 + 0.6 * x) ** 2])
def test_box_converges_to_the_free_parallelepiped_at_second_order(profile):
    """Also with a modulus that is sixteen times as high at one end as at the other."""
    sides = (0.12, 0.08, 0.04)
    degrees = (10, 10, 10)
    # Products of a modulus of degree 2 are integrated exactly as well.
    domain = domains.box(sides, (12, 10, 10))
    young = 1e9 * profile(domain.points[:, 0] / 0.06)
    exact = free_eigenvalues(domain, degrees, young, POISSON, DENSITY)[6:16]
    sizes, errors = np.array([6, 8, 12]), []
    for cells in sizes:
        mesh = solids.box_mesh(3 * cells // 2, cells, cells // 2, 0.08 / cells)
        middles = mesh.nodes[mesh.cells].mean(axis=1)[:, 0] / 0.06 - 1.0
        values = spectrum(fine_model(mesh, 1e9 * profile(middles)), method="slepc", modes=16)[6:]
        errors.append(np.sqrt(values / exact) - 1.0)
    assert (np.array(errors) > 0.0).all()
    # The mean, since modes that lie close come in another order on another mesh.
    assert 1.85 < np.polyfit(np.log(1.0 / sizes), np.log(np.mean(errors, axis=1)), 1)[0] < 2.1
    assert max(errors[-1]) < 0.03


def test_slender_bar_bends_as_timoshenko_says():
    length, side = 0.32, 0.04
    frequencies = []
    for cells in (4, 8):
        model = solids.uniform_box(8 * cells, cells, cells, side / cells)
        frequencies.append(np.sqrt(spectrum(model, method="slepc", modes=12)[6]) / (2.0 * np.pi))
    expected = solids.timoshenko_free_frequencies(length, side, 1e9, POISSON, DENSITY, 1)[0]
    # Richardson extrapolation of a second-order element.
    extrapolated = frequencies[1] + (frequencies[1] - frequencies[0]) / 3.0
    assert abs(extrapolated / expected - 1.0) < 0.005


def test_clustered_modes_of_a_cube_span_the_same_subspaces():
    model = solids.uniform_box(6, 6, 6, 0.01)
    K, M = assembled(model)
    exact, truth = la.eigh(K.toarray(), M.toarray(), subset_by_index=[6, 60])
    result = solids.analysed(model, modes=61, tolerance=1e-10, subdomains=5)
    vectors = result.system.gather(result.vectors)[:, 6:]
    groups = clusters(exact)[:-1]
    assert max(group.stop - group.start for group in groups) >= 3
    assert subspace_angles(vectors, truth, sp.csr_matrix(M), groups).max() < 1e-3


def test_more_modes_than_unknowns_is_an_error():
    model = solids.uniform_box(1, 1, 1, 0.01)
    with pytest.raises(UserError, match="30 modes asked for, but the model has 24 unknowns"):
        spectrum(model, modes=30)


def test_every_mode_of_a_tiny_model_can_be_asked_for():
    model = solids.random_box(2, 2, 1)
    exact = solids.dense_eigenvalues(model)
    assert np.allclose(spectrum(model, modes=model.n_dofs)[6:], exact[6:], rtol=1e-9)


def test_hinged_model_is_refused():
    mesh = solids.hexmesh_from_grid(np.array([[0, 0, 0], [1, 1, 0]]), np.zeros(3), 0.01)
    model = fine_model(mesh, np.full(2, 1e9))
    with pytest.raises(ConvergenceError, match="zero-frequency mode"):
        spectrum(model, modes=20)
