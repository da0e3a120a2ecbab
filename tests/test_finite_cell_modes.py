"""Modes of finite cells are those of the real solid, by every method and on any number of ranks."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from carillon.errors import UserError
from carillon.fem.element import rigid_motions
from carillon.fem.finite_cells.build import covering, finite_cells
from carillon.fem.finite_cells.model import finite_cell_model
from carillon.fem.geometry import builtin_surface
from carillon.fem.materials import young_modulus
from solver.__main__ import main
from solver.accuracy.divide import DividedCells
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.options import SolverOptions
from solver.analysis.problem import ProblemOptions, build_problem
from solver.assembly.sparse import assembled
from solver.files.modes_file import read_modes, write_modes
from solver.hcms.condense import INTERFACES
from solver.refinement.errors import ALLOWED_DISTANCE
from solver.response.points import interpolation
from solver.verification.comparison import compare_files
from solver.verification.fitted import fitted
from studies.accuracy import domains
from studies.accuracy.ritz import free_eigenvalues
from studies.accuracy.solids import SOLIDS
from tests import cut_solids, solids
from tests.cut_solids import box, spaced, turned, uniform
from tests.edited_files import edited, put
from tests.rank_counts import TO_THREE

PROGRAM = Path(__file__).with_name("distributed_checks.py")


@pytest.fixture(scope="module")
def material():
    """A tilted bar of random moduli, small enough for LAPACK."""
    cells = spaced(turned(box(0.2, 0.05, 0.03)), 0.025)
    young = 1e9 * 10.0 ** np.random.default_rng(3).uniform(-1.5, 1.5, cells.mesh.n_cells)
    return finite_cell_model(cells, young)


@pytest.mark.parametrize(
    ("name", "spacing", "goal"),
    [("plate", 0.024, 0.06), ("block", 0.02, 0.003)],
    ids=["plate half as thick as the spacing", "block"],
)
def test_solids_turned_against_the_lattice(name, spacing, goal):
    """As the command has them: cells with large errors are divided."""
    solid = SOLIDS[name]
    exact = solid.frequencies(30, fewer=4)
    surface = solid.surface()
    cover = covering(surface, round(float(np.ptp(surface.bounds, axis=0).max()) / spacing))
    cells, done = DividedCells(cover, uniform(cover.cells)), False
    while not done:
        found = solids.analysed(cells.model, modes=36, method="slepc")
        modes = found.system.gather(found.vectors)
        done = cells.advance(found.values, modes, ALLOWED_DISTANCE)[1]
    errors = np.sqrt(found.values[6:]) / (2.0 * np.pi * exact) - 1.0
    assert np.sqrt(np.mean(errors**2)) < goal


def test_the_bells_equal_pairs_stay_pairs():
    values = cut_solids.eigenvalues(uniform(finite_cells(builtin_surface("bell"), 16)), 10)
    pairs = np.sqrt(values[6:10].reshape(2, 2))
    assert (pairs[:, 1] / pairs[:, 0] - 1.0 < 0.005).all()


def test_frequencies_fall_towards_those_of_the_solid():
    sides = (0.2, 0.1, 0.05)
    degrees = (10, 10, 10)
    constants = cut_solids.YOUNG, cut_solids.POISSON, cut_solids.DENSITY
    exact = free_eigenvalues(domains.box(sides, degrees), degrees, *constants)[6:12]
    errors = []
    for spacing in (0.05, 0.025, 0.0125):
        model = uniform(spaced(turned(box(*sides)), spacing))
        errors.append(np.abs(cut_solids.eigenvalues(model, 12)[6:] / exact - 1))
    # The solution by polynomials is near to a hundred-thousandth or so itself.
    assert (errors[1] < errors[0]).all() and (errors[2] < np.maximum(errors[1], 2e-5)).all()
    # Fourth order in the spacing where modes are smooth; edges take a part of it.
    rates = np.log2(errors[0] / errors[2]) / 2.0
    assert rates.min() > 2.0 and np.median(rates) > 2.5


@pytest.mark.parametrize(
    ("method", "interface"),
    [("hcms", name) for name in INTERFACES] + [("slepc", "overlapping"), ("arpack", "overlapping")],
)
def test_every_method_finds_the_modes(material, method, interface):
    given = {"modes": 24, "subdomains": 4, "tolerance": 1e-10}
    values = solids.analysed(material, method=method, interface=interface, **given).values
    exact = solids.dense_eigenvalues(material)
    assert np.abs(values[6:] / exact[6:24] - 1.0).max() < 1e-7


def test_a_millionfold_contrast_where_the_surface_cuts(material):
    young = 1e9 * 10.0 ** np.random.default_rng(4).uniform(-3.0, 3.0, len(material.young))
    model = material.with_young(young)
    exact = solids.dense_eigenvalues(model)
    for method in ("hcms", "slepc"):
        values = solids.analysed(model, modes=16, method=method).values
        assert np.abs(values[6:] / exact[6:16] - 1.0).max() < 1e-5


def test_other_moduli_without_another_analysis(material):
    solver = ModalSolver(material, SolverOptions(modes=12, tolerance=1e-10))
    first = solver.solve()
    young = material.young * np.linspace(0.9, 1.1, len(material.young))
    warm = solver.solve(young, initial_modes=first)
    cold = solids.analysed(material.with_young(young), modes=12, tolerance=1e-10)
    assert np.abs(warm.values[6:] / cold.values[6:] - 1.0).max() < 1e-8
    with pytest.raises(UserError, match="moduli: an array of shape"):
        solver.solve(young[:-1])


@pytest.mark.mpi
@pytest.mark.parametrize("ranks", TO_THREE)
def test_ranks_agree(mpiexec, ranks):
    mpiexec(ranks, PROGRAM, "finite_cells_on_ranks", check=True)


@pytest.fixture(scope="module")
def written(tmp_path_factory, material):
    path = tmp_path_factory.mktemp("cells") / "modes.h5"
    modes = solids.analysed(material, modes=12, method="slepc")
    block = modes.system.gather(modes.vectors)
    write_modes(path, material, modes.values, [block], modes.residuals, {"method": "slepc"}, {})
    return path


def test_files_hold_the_solid(written, material):
    file = read_modes(written)
    assert np.array_equal(file.model.young, material.young)
    assert np.allclose(file.model.stiffness(), material.stiffness(), rtol=1e-12)
    compared = compare_files(written, written)
    assert compared.residual_max < 1e-6 and "matched" not in compared.as_dict()


def test_modes_of_voxels_are_told_on_finite_cells_and_back(tmp_path):
    """A box in the lattice: both discretisations have the same solid, and its modes one by one."""
    for name, options in (
        ("voxels", ProblemOptions("builtin:box", 16)),
        ("cells", ProblemOptions("builtin:box", 8, discretisation="finite-cell")),
    ):
        model = build_problem(options).model
        modes = solids.analysed(model, modes=12, method="slepc")
        block = modes.system.gather(modes.vectors)
        write_modes(tmp_path / name, model, modes.values, [block], modes.residuals, {}, {})
    for one, other in (("voxels", "cells"), ("cells", "voxels")):
        compared = compare_files(tmp_path / one, tmp_path / other)
        assert compared.subspace_angle_max < 0.05
        assert compared.frequency_max_relative_error_7_60 < 0.03
        matched = compared.matched
        assert (matched["modes"], matched["moved"]) == (6, 0) and matched["overlap_median"] > 0.99
        assert abs(matched["worst"]) == compared.frequency_max_relative_error_7_60


@pytest.mark.parametrize("levels", range(5))
def test_modes_are_told_on_cells_divided_any_number_of_times(levels):
    cover = covering(builtin_surface("frying-pan"), 16)
    divided = uniform(cut_solids.divided(cover, (0.2,) * levels))
    whole = uniform(cover.cells)
    modes = solids.analysed(whole, modes=12, method="slepc")
    found = modes.system.gather(modes.vectors)
    still = rigid_motions(whole.positions, np.zeros(3))
    told = fitted(divided, whole, np.concatenate([found, still], axis=1))
    mass = assembled(divided)[1]
    norms = np.einsum("ik,ik->k", told, mass @ told)
    assert norms[:12] == pytest.approx(1.0, rel=2e-3)
    moved = rigid_motions(divided.positions, np.zeros(3))
    assert norms[12:] == pytest.approx(np.einsum("ik,ik->k", moved, mass @ moved), rel=1e-5)


@pytest.mark.parametrize(
    "change",
    [
        ("finite_cells/row", lambda values: values + 10**6),
        ("finite_cells/row", lambda values: values[1:]),
        ("finite_cells/nodes", lambda values: values[:, ::-1]),
        ("finite_cells/nodes", lambda values: values - 1),
        ("finite_cells/nodes", lambda values: values[1:]),
        ("finite_cells/corner", lambda values: values + 1),
        ("finite_cells/span", lambda values: 2 * values),
        ("finite_cells/span", lambda values: 0 * values),
        ("finite_cells/kinds", lambda values: values + 8),
        ("finite_cells/kinds", lambda values: values + (8 << 6)),
        ("finite_cells/voxel_nodes", lambda values: values + 1),
        ("finite_cells/cell", lambda values: values[::-1]),
        ("finite_cells/cell", lambda values: values + 1),
        ("finite_cells/place", lambda values: values + 64),
        ("finite_cells/voxel", lambda values: values + 1),
        ("finite_cells/voxel", lambda values: values - 10**6),
        ("finite_cells/weights", lambda values: values[:1]),
        ("finite_cells/weights", lambda values: -values),
        ("finite_cells/weights", lambda values: np.where(np.arange(295) == 3, np.nan, values)),
        ("young", lambda values: values[:-1]),
    ],
    ids=lambda change: change[0],
)
def test_files_that_do_not_fit_are_refused(written, tmp_path, change):
    path = tmp_path / "other.h5"
    path.write_bytes(written.read_bytes())
    with edited(path) as file:
        put(*change)(file)
    with pytest.raises(UserError):
        read_modes(path)


@pytest.mark.parametrize("factor", [2.0, 0.99])
def test_steps_of_nodes_that_are_not_those_of_voxels_are_refused(written, tmp_path, factor):
    path = tmp_path / "other.h5"
    path.write_bytes(written.read_bytes())
    with edited(path) as file:
        file["finite_cells"].attrs["step"] *= factor
    with pytest.raises(UserError, match="do not fit each other"):
        read_modes(path)


def test_the_command_writes_what_it_found(tmp_path, run_cli):
    out = tmp_path / "bell.h5"
    words = ["builtin:bell", "--resolution", "10", "--discretisation", "finite-cell"]
    done = run_cli("solver", "modes", *words, "--modes", "9", "--out", out, check=True)
    assert "9 modes of" in done.stdout
    with h5py.File(out) as file:
        assert file.attrs["discretisation"] == "finite-cell"


@pytest.mark.parametrize(
    "words", [["--coarsen", "average"], ["--lumped"], ["--fill", "centre"]], ids=lambda w: w[0]
)
def test_what_is_for_voxels_is_refused(words):
    given = {words[0][2:]: words[1] if len(words) > 1 else True}
    options = ProblemOptions("builtin:bar", 8, discretisation="finite-cell", **given)
    with pytest.raises(UserError, match="is for voxels; leave it out"):
        build_problem(options)


@pytest.mark.parametrize("name", ["smooth", "two-region", "noise"])
def test_named_materials(name):
    problem = build_problem(ProblemOptions("builtin:bar", 12, name, discretisation="finite-cell"))
    assert problem.young.shape == (problem.fine.n_cells,)
    assert np.array_equal(problem.young, young_modulus(name, problem.fine))


def test_a_material_of_voxels_is_refused(tmp_path):
    path = str(tmp_path / "young.npy")
    np.save(path, build_problem(ProblemOptions("builtin:bar", 12)).young)
    with pytest.raises(UserError, match="young.npy"):
        build_problem(ProblemOptions("builtin:bar", 12, path, discretisation="finite-cell"))


def test_points_of_the_surface_move_with_it():
    """Quartic displacements are found exactly wherever a point of the solid lies."""
    surface = turned(box(0.2, 0.12, 0.05))
    model = uniform(spaced(surface, 0.02))
    points = np.asarray(surface.subdivide().vertices)

    def field(places):
        x, y, z = places.T / 0.1
        return x**3 * y - z**4 + x * y * z**2

    found = interpolation(model, points) @ field(model.positions)
    assert np.allclose(found, field(points), atol=1e-12)


def test_bad_words_get_one_sentence(refuses):
    sentence = refuses(
        main, "modes", "builtin:bar", "--resolution", "8", "--discretisation", "cubes"
    )
    assert "finite-cell" in sentence
