"""Finite cells know how far they are from the solid, and are divided where that is too far."""

import json

import numpy as np
import pytest

from carillon.errors import UserError
from carillon.fem.block import NODES, degrees_of_freedom
from carillon.fem.element import elasticity_matrix
from carillon.fem.finite_cells import hanging
from carillon.fem.finite_cells.build import covering, finite_cells
from carillon.fem.finite_cells.covering import Covering
from carillon.fem.finite_cells.shapes import shape_functions
from carillon.fem.geometry import builtin_surface
from carillon.fem.geometry.grid import Grid
from carillon.fem.laplacian import laplacian_modes
from solver.__main__ import main
from solver.accuracy import solving
from solver.accuracy.divide import DividedCells
from solver.accuracy.estimate import estimate_cell_errors
from solver.files.modes_file import read_modes
from studies.accuracy.solids import SOLIDS
from tests import cut_solids, solids
from tests.cut_solids import spaced, uniform
from tests.rank_counts import TO_THREE

CELLS = ["--discretisation", "finite-cell"]


def divided(name: str, resolution: int, share: float = 0.4):
    """The undivided cells of a built-in solid, and the same with some of them divided."""
    cover = covering(builtin_surface(name), resolution)
    places = np.unique(cover.cells.grid, axis=0)
    chosen = np.random.default_rng(1).random(len(places)) < share
    return cover.cells, cover.divided(places[chosen])


@pytest.fixture(scope="module", params=["bell", "fork"])
def some(request):
    return divided(request.param, 14)


def solved(model, modes, method="slepc"):
    found = solids.analysed(model, modes=modes, method=method)
    return found.values, found.system.gather(found.vectors)


def test_divided_cells_fit_each_other(some):
    whole, division = some
    cells = division.cells
    assert cells.is_mixed and cells.is_consistent()
    assert set(np.unique(cells.span)) == {2, 4}
    assert cells.volume == pytest.approx(whole.volume, rel=1e-2)
    assert (np.diff(np.unique(division.parent)) > 0).all()
    np.testing.assert_array_equal(cells.grid // 4 * 2, whole.grid[division.parent])
    # In one piece, by the neighbours that share faces.
    assert (laplacian_modes(uniform(cells).hexmesh, 2)[0] > 1e-9).tolist() == [False, True]


def test_linear_displacements_have_the_energy_of_the_solid(some):
    cells = some[1].cells
    model = uniform(cells)
    nodes = degrees_of_freedom(cells.nodes.astype(np.int64))
    stiffness = model.stiffness()
    strain = np.array([[1.0, 0.3, 0.2], [0.3, -1.0, 0.5], [0.2, 0.5, 0.7]])
    for gradient in (strain, np.array([[0.0, 1.0, -2.0], [-1.0, 0.0, 3.0], [2.0, -3.0, 0.0]])):
        motion = (cells.mesh.nodes @ gradient).ravel()[nodes]
        energy = np.einsum("ci,cij,cj->", motion, stiffness, motion)
        sym = 0.5 * (gradient + gradient.T)
        voigt = np.array([*np.diag(sym), 2 * sym[0, 1], 2 * sym[1, 2], 2 * sym[0, 2]])
        exact = cut_solids.YOUNG * cells.volume * voigt @ elasticity_matrix(0.25) @ voigt
        assert energy == pytest.approx(exact, rel=1e-6, abs=1e-8 * cut_solids.YOUNG * cells.volume)


def test_all_divided_are_those_of_the_finer_lattice():
    surface = builtin_surface("bell")
    cover = covering(surface, 8)
    cells = cover.divided(np.unique(cover.cells.grid, axis=0)).cells
    nx, ny, nz = (2 * size for size in cover.grid.shape)
    lattice = Grid(cover.grid.origin, cover.grid.edge / 2.0, (nx, ny, nz))
    fine = uniform(finite_cells(surface, 16, grid=lattice))
    assert cells.mesh.n_nodes == fine.mesh.n_nodes and not cells.is_mixed
    found, exact = (cut_solids.eigenvalues(model, 14)[6:] for model in (uniform(cells), fine))
    np.testing.assert_allclose(found, exact, rtol=1e-7)


def test_hanging_nodes_say_what_the_whole_cell_says():
    """A quadratic field on a whole cell is the same in the small ones that hang from it."""
    field = np.random.default_rng(2).standard_normal(27)
    for octant in range(8):
        corner = np.array([octant & 1, octant >> 1 & 1, octant >> 2])
        low = corner == 0
        on_faces = ((NODES == 0) & low) | ((NODES == 2) & ~low)
        middles = (NODES == 1).any(axis=1)
        # All that lies on the three outer faces of the whole cell hangs.
        kind = hanging.kinds_of_cells(np.array([octant]), (on_faces.any(axis=1) & middles)[None])
        places = (corner * 2 + hanging.node_places(kind)[0]) / 4.0
        values = hanging.node_weights(kind)[0] @ (shape_functions(places) @ field)
        np.testing.assert_allclose(
            values, shape_functions((corner * 2 + NODES) / 4.0) @ field, atol=1e-12
        )


def test_every_method_finds_their_modes(some):
    model = uniform(some[1].cells)
    found = [solved(model, 20, method)[0][6:] for method in ("hcms", "slepc")]
    np.testing.assert_allclose(*found, rtol=1e-7)


def test_frequencies_fall_where_cells_are_divided():
    whole, division = divided("fork", 14)
    coarse, fine = (
        cut_solids.eigenvalues(uniform(cells), 20)[6:] for cells in (whole, division.cells)
    )
    assert (fine < coarse * (1.0 + 1e-3)).all() and fine[0] < 0.98 * coarse[0]


@pytest.mark.parametrize(
    ("name", "spacing"), [("ellipsoid", 0.03), ("block", 0.03), ("beam", 0.02)]
)
def test_no_mode_is_slower_than_that_of_the_solid(name, spacing):
    """What a surface barely cuts off moves with its neighbours."""
    solid = SOLIDS[name]
    exact = solid.frequencies(30, fewer=4)
    values = cut_solids.eigenvalues(uniform(spaced(solid.surface(), spacing)), 36)[6:]
    assert (np.sqrt(values) / (2.0 * np.pi * exact)).min() > 0.998


@pytest.mark.parametrize(
    ("name", "spacing"), [("block", 0.03), ("plate", 0.02), ("sphere", 0.03), ("cylinder", 0.03)]
)
def test_expected_errors_are_about_the_true_ones(name, spacing):
    solid = SOLIDS[name]
    exact = solid.frequencies(30, fewer=4)
    model = uniform(spaced(solid.surface(), spacing))
    values, modes = solved(model, 36)
    expected = estimate_cell_errors(model, values, modes)
    true = np.sqrt(values[6:]) / (2.0 * np.pi * exact) - 1.0
    assert 1.0 / 3.0 < expected.errors.rms / np.sqrt(np.mean(true**2)) < 3.0
    assert (expected.shares >= 0.0).all() and len(expected.shares) == len(model.cells)


def test_cells_are_divided_where_edges_point_inwards():
    cover = covering(builtin_surface("frying-pan"), 20)
    model = uniform(cover.cells)
    cells = DividedCells(cover, model)
    first, done = cells.advance(*solved(model, 30), 0.02)
    assert not done and first.errors.rms > 0.02
    assert cells.model.n_dofs < 2 * model.n_dofs
    second, _ = cells.advance(*solved(cells.model, 30), 0.02)
    assert second.errors.rms < 0.7 * first.errors.rms
    # The handle's joint, on one side of the pan.
    middle = cells.model.cells.grid[cells.model.cells.span == 2].mean(axis=0)
    assert middle[0] > 1.2 * cells.model.cells.grid[:, 0].mean()


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """A pan divided in this process: the command's arguments and the file."""
    out = str(tmp_path_factory.mktemp("alone") / "modes.h5")
    arguments = ["modes", "builtin:frying-pan", "--resolution", "16", "--modes", "20", *CELLS]
    arguments += ["--refine-to", "0.03", "--material", "two-region"]
    main([*arguments, "--out", out])
    return arguments, read_modes(out)


@pytest.mark.mpi
@pytest.mark.parametrize("ranks", TO_THREE)
def test_any_number_of_ranks_divides_the_same_cells(ranks, alone, mpiexec, tmp_path):
    arguments, expected = alone
    out = tmp_path / "modes.h5"
    mpiexec(ranks, "solver", *arguments, "--out", out, check=True)
    found = read_modes(out)
    assert found.attributes["divided_cells"] == expected.attributes["divided_cells"] > 0
    np.testing.assert_array_equal(found.model.connectivity, expected.model.connectivity)
    np.testing.assert_allclose(found.eigenvalues[6:], expected.eigenvalues[6:], rtol=1e-6)


def test_files_hold_divided_cells(alone):
    file = alone[1]
    assert file.model.cells.is_mixed and file.model.cells.is_consistent()
    values = solids.analysed(file.model, modes=20, method="slepc").values
    np.testing.assert_allclose(values[6:], file.eigenvalues[6:], rtol=1e-6)
    # Two materials: the voxels of divided cells have those of where they are.
    assert len(np.unique(file.model.young)) == 2


def test_voxels_are_told_their_distance(tmp_path, capsys):
    out = str(tmp_path / "modes.h5")
    command = ["modes", "builtin:bell", "--resolution", "12", "--modes", "16", "--out", out]
    main([*command, "--json"])
    told = json.loads(capsys.readouterr().out)
    exact = cut_solids.eigenvalues(uniform(finite_cells(builtin_surface("bell"), 24)), 16)[6:]
    true = np.array(told["frequencies_hz"][6:]) * 2.0 * np.pi / np.sqrt(exact) - 1.0
    assert 0.7 < told["solid_frequency_error_rms"] / np.sqrt(np.mean(true**2)) < 1.4
    main([*command, "--no-estimate"])
    assert "distance" not in capsys.readouterr().out


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["plate", "rin", "handbell"])
@pytest.mark.parametrize("resolution", [4, 6])
def test_far_too_large_cells_say_that_they_are_far_off(name, resolution, tmp_path, capsys):
    out = str(tmp_path / "modes.h5")
    command = ["modes", f"builtin:{name}", "--modes", "36", *CELLS, "--out", out, "--json"]
    told = []
    for spacings in (resolution, 32):
        main([*command, "--resolution", str(spacings)])
        told.append(json.loads(capsys.readouterr().out))
    here, near = (np.array(each["frequencies_hz"][6:]) for each in told)
    ratio = told[0]["solid_frequency_error_rms"] / np.sqrt(np.mean((here / near - 1.0) ** 2))
    # As docs/explanation/finite-cells.md says: large, but perhaps less than half of the true one.
    assert told[0]["solid_frequency_error_rms"] > 0.14 and 0.4 < ratio < 2.2


def test_cells_stay_whole_where_dividing_them_fails(tmp_path, capsys, monkeypatch):
    def fails(*_):
        raise UserError("it falls apart")

    monkeypatch.setattr(Covering, "divided", fails)
    out = str(tmp_path / "modes.h5")
    command = ["modes", "builtin:frying-pan", "--resolution", "12", "--modes", "12", *CELLS]
    main([*command, "--out", out])
    told = capsys.readouterr()
    assert "no more cells are divided: it falls apart" in told.err and "0 cells divided" in told.out
    main([*command, "--no-estimate", "--out", out])
    told = capsys.readouterr()
    assert "distance" not in told.out and "divided" not in told.err


def test_a_resolution_is_chosen(tmp_path, capsys, monkeypatch):
    out = str(tmp_path / "modes.h5")
    command = ["modes", "builtin:plate", "--modes", "16", *CELLS, "--out", out]
    main([*command, "--resolution", "6", "--accuracy", "0.02", "--json"])
    told = json.loads(capsys.readouterr().out)
    assert told["resolution"] > 6 and told["solid_frequency_error_rms"] <= 0.02
    assert read_modes(out).attributes["resolution"] == told["resolution"]
    monkeypatch.setattr(solving, "MOST_UNKNOWNS", 1000)
    assert main([*command, "--resolution", "6", "--accuracy", "0.0001"]) == 2
    assert "--accuracy 0.0001 needs more than 1,000 unknowns" in capsys.readouterr().err
    assert main(command) == 2
    assert "expected --resolution" in capsys.readouterr().err
    young = tmp_path / "young.txt"
    np.savetxt(young, np.full(finite_cells(builtin_surface("plate"), 6).mesh.n_cells, 1e9))
    of_file = ["--resolution", "6", "--accuracy", "0.0001", "--material", str(young)]
    assert main([*command, *of_file]) == 2
    assert "is of the voxels of that one" in capsys.readouterr().err
