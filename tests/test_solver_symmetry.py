"""Solids of many symmetries have crowded spectra: every copy is found, by every method."""

import json

import numpy as np
import pytest
import trimesh
from mpi4py import MPI

from carillon.fem.finite_cells.build import finite_cells
from carillon.fem.geometry import hexmesh_from_voxels, voxelize
from carillon.fem.model import RIGID_MODES, fine_model
from solver.__main__ import main
from solver.assembly.system import Layout, assemble
from solver.correction import random_start
from solver.correction.enrichment import Ritz
from solver.correction.krylov import KrylovBasis
from solver.correction.shift import MOST, inverse_amid
from solver.distribution.local_mesh import distribute
from solver.linear import LinearSolver
from solver.subspace.basis import BlockBasis
from solver.subspace.start import start_block
from solver.subspace.weyl import CountingLaw
from tests import cut_solids, solids, theories

COMM = MPI.COMM_SELF
RADIUS = 0.1
CORNERS = RADIUS * np.concatenate([np.eye(3), -np.eye(3)])


def octahedron():
    """With its corners on the axes."""
    return trimesh.convex.convex_hull(CORNERS)


def tetrahedron():
    """Every other corner of a cube."""
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    return trimesh.convex.convex_hull(RADIUS * corners)


BODIES = {
    "octahedron": octahedron,
    "tetrahedron": tetrahedron,
    "cube": lambda: cut_solids.box(0.2, 0.2, 0.2),
    "square plate": lambda: cut_solids.box(0.2, 0.2, 0.05),
    "ball": lambda: trimesh.creation.icosphere(2, RADIUS),
    "ball of meridians": lambda: trimesh.creation.uv_sphere(RADIUS, (12, 12)),
    "turned ball": lambda: cut_solids.turned(trimesh.creation.icosphere(2, RADIUS)),
}

GUARDS = ("octahedron", "ball of meridians")
"""Bodies that every run tries."""


def model_of(body, resolution, discretisation):
    """Of one modulus, of voxels or finite cells."""
    surface = BODIES[body]()
    if discretisation == "finite-cell":
        return cut_solids.uniform(finite_cells(surface, resolution))
    mesh = hexmesh_from_voxels(voxelize(surface, resolution))
    return fine_model(mesh, np.full(mesh.n_cells, 1e9))


def system_of(model):
    """Its matrices on this rank, and what inverts them."""
    local_mesh = distribute(model, 1, comm=COMM)
    layout = Layout.of_local_mesh(local_mesh, COMM)
    return assemble(local_mesh, COMM, layout), LinearSolver("multifrontal", layout)


@pytest.mark.parametrize(
    "body",
    [body if body in GUARDS else pytest.param(body, marks=pytest.mark.nightly) for body in BODIES],
)
@pytest.mark.parametrize("discretisation", ["voxel", "finite-cell"])
def test_every_copy_is_found_however_many_modes_are_asked_for(body, discretisation):
    model = model_of(body, 6, discretisation)
    exact = solids.dense_eigenvalues(model)
    for modes in (7, 12, 31, 32, 33, 60):
        for method in ("lanczos", "hcms"):
            found = solids.analysed(model, modes=modes, method=method, tolerance=1e-8).values
            error = np.abs(found[RIGID_MODES:] / exact[RIGID_MODES:modes] - 1.0)
            assert error.max() <= 1e-8, (method, modes)


@pytest.mark.parametrize("seed", range(3))
def test_one_of_five_modes_that_are_all_but_equal_is_found(seed):
    model = model_of("ball", 6, "finite-cell")
    exact = solids.dense_eigenvalues(model)
    found = solids.analysed(model, modes=7, method="hcms", seed=seed)
    assert abs(found.values[-1] / exact[RIGID_MODES] - 1.0) <= 1e-7 and len(found.values) == 7


@pytest.mark.parametrize("body", ["octahedron", "tetrahedron", "cube"])
@pytest.mark.parametrize(
    "resolution", [3, *(pytest.param(each, marks=pytest.mark.nightly) for each in (4, 5))]
)
def test_nearly_all_modes_of_a_small_model_can_be_asked_for(body, resolution):
    """The Krylov space is exhausted; nothing but rounding is left of its next vectors."""
    model = model_of(body, resolution, "voxel")
    exact = solids.dense_eigenvalues(model)
    for modes in (60, 2 * model.n_dofs // 3, model.n_dofs - 1):
        for method in ("auto", "lanczos", "hcms"):
            found = solids.analysed(model, modes=modes, method=method).values
            error = np.abs(found[RIGID_MODES:] / exact[RIGID_MODES:modes] - 1.0)
            assert error.max() <= 1e-7, (method, modes)


@pytest.mark.parametrize(
    ("resolution", "modes"), [(10, 60), pytest.param(16, 32, marks=pytest.mark.nightly)]
)
def test_a_ball_sounds_as_lamb_says(resolution, modes):
    surface = trimesh.creation.icosphere(4, RADIUS)
    model = cut_solids.uniform(finite_cells(surface, resolution))
    # As large as its faces make it.
    radius = (0.75 * surface.volume / np.pi) ** (1.0 / 3.0)
    found = solids.analysed(model, modes=modes, tolerance=1e-6)
    hertz = np.sqrt(found.values[RIGID_MODES:]) / (2.0 * np.pi)
    constants = cut_solids.YOUNG, cut_solids.POISSON, cut_solids.DENSITY
    exact = theories.sphere_frequencies(radius, *constants, 1.1 * hertz[-1])
    shear = cut_solids.YOUNG / (2.0 * (1.0 + cut_solids.POISSON) * cut_solids.DENSITY)
    assert np.allclose(2.0 * np.pi * exact[:5] * radius / np.sqrt(shear), 2.5011, atol=1e-4)
    # Finite cells of 20 mm are 0.2 % off, rms (docs/explanation/finite-cells.md), the last most.
    assert np.allclose(hertz, exact[: len(hertz)], rtol=0.02)
    assert np.allclose(hertz[:5], exact[:5], rtol=2e-3)


@pytest.mark.parametrize("words", [[], ["--discretisation", "finite-cell", "--refine-to", "0"]])
def test_the_command_writes_the_modes_of_an_octahedron(words, tmp_path, capfd):
    mesh, out = tmp_path / "octahedron.stl", tmp_path / "modes.h5"
    octahedron().export(mesh)
    command = ["modes", str(mesh), "--resolution", "16", "--modes", "60", *words]
    assert main([*command, "--json", "--out", str(out)]) == 0
    output = capfd.readouterr()
    summary = json.loads(output.out)
    assert "solid_frequency_error_rms" in summary and "warning" not in output.err
    if words:
        # With 32 spacings it is 2864.1 Hz.
        np.testing.assert_allclose(summary["frequencies_hz"][6:9], 2864.2, rtol=2e-4)


def test_no_shift_lies_beyond_a_crowd_of_the_wanted_eigenvalues():
    model = model_of("octahedron", 6, "finite-cell")
    system, linear = system_of(model)
    exact = solids.dense_eigenvalues(model)[RIGID_MODES:]
    terms = CountingLaw.of_solid(model, model.young, 60).terms
    for requested in (1, 2, 3, 5, 9, 27, 54):
        for wrong in (0.1, 1.0, 10.0):
            law = CountingLaw(tuple(term / wrong for term in terms))
            inverse = inverse_amid(system, linear, requested, law)
            assert inverse.negative - RIGID_MODES <= MOST * requested
            assert inverse.shift < exact[requested - 1]


def test_a_shift_beyond_most_wanted_eigenvalues_is_taken_back(monkeypatch):
    model = model_of("octahedron", 6, "finite-cell")
    exact = solids.dense_eigenvalues(model)[RIGID_MODES:]
    shifts = []

    def beyond(system, linear, *_):
        shifts.append(1.2 * exact[53])
        return linear.inverse(system, shifts[-1])

    monkeypatch.setattr(random_start, "inverse_amid", beyond)
    found = solids.analysed(model, modes=60, method="lanczos")
    assert np.abs(found.values[RIGID_MODES:] / exact[:54] - 1.0).max() <= 1e-7
    assert len(shifts) == 1


def test_an_invariant_space_goes_on_with_random_vectors():
    """A start of exact modes spans an invariant space at once."""
    model = solids.random_box(4, 3, 3)
    system, linear = system_of(model)
    modes = solids.analysed(model, modes=14, tolerance=1e-10).vectors[:, RIGID_MODES:]
    inverse = linear.inverse(system, 0.5 * solids.dense_eigenvalues(model)[30])
    basis = KrylovBasis(system, inverse, np.ascontiguousarray(modes), 60)
    basis.extend()
    basis.go_on_with(start_block(system, 8, 0))
    for _ in range(4):
        basis.extend()
    _, vectors = basis.ritz_pairs(30)
    assert np.abs(system.inner(vectors, system.times_mass(vectors)) - np.eye(30)).max() < 1e-8


def test_a_basis_takes_more_narrow_blocks_than_wide_ones():
    system, _ = system_of(solids.random_box(4, 3, 3))
    basis = BlockBasis(system, 8, 2)
    vectors = np.random.default_rng(0).standard_normal((system.n_dofs, 7))
    for column in range(7):
        basis.append(vectors[:, column : column + 1])
    np.testing.assert_allclose(basis.inner(vectors), vectors.T @ vectors, rtol=1e-12)


def test_vectors_that_were_locked_too_early_are_unlocked():
    system, _ = system_of(solids.random_box(3, 2, 2))
    ritz = Ritz(system, np.arange(1.0, 7.0), start_block(system, 6, 0))
    ritz.lock(np.array([1, 2, 4]))
    ritz.unlock(np.array([4, 5]))
    assert ritz.locked == 2 and ritz.active.tolist() == [0, 3, 4, 5]
