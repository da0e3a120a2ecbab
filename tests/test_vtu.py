"""Modes are written for ParaView, PyVista and meshio as the solid has them."""

import xml.etree.ElementTree as ET

import meshio
import numpy as np
import pytest

import carillon as ca
from carillon.command_line.exit_status import EXIT_BAD_INPUT
from carillon.fem.finite_cells.build import covering
from carillon.fem.geometry import CORNER_OFFSETS, builtin_surface
from carillon.files.vtu import HEXAHEDRON_CORNERS
from solver.__main__ import main
from solver.exchange.displayed import DENSITY, YOUNG, displayed
from solver.response.points import voxel_motion
from tests import solids
from tests.cut_solids import divided, uniform
from tests.test_refinement import mixed_model


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Modes files of voxels, of coarse elements and of finite cells."""
    folder = tmp_path_factory.mktemp("modes")
    steel = ca.Material.named("steel")
    ca.solve("builtin:bar", steel, resolution=12, modes=8).save(folder / "voxels.h5")
    coarse = ca.coarsen("builtin:bar", steel, resolution=12, method="average")
    ca.solve(coarse, modes=8).save(folder / "coarse.h5")
    cells = {"resolution": 8, "modes": 8, "discretisation": "finite-cell"}
    ca.solve("builtin:bar", steel, **cells).save(folder / "cells.h5")
    return folder


def _models():
    yield "voxels", solids.random_box(3, 2, 2)
    yield "coarse", solids.bar_models()[2]
    yield from ((f"mixed {seed}", mixed_model(seed)[1]) for seed in range(3))
    yield "divided", uniform(divided(covering(builtin_surface("bell"), 12), (0.3, 0.1)))
    yield "whole", uniform(covering(builtin_surface("fork"), 12).cells)


MODELS = list(_models())


@pytest.mark.parametrize("model", [model for _, model in MODELS], ids=[name for name, _ in MODELS])
def test_cubes_are_the_elements_where_they_are(model):
    """Those with hanging corners too, whose nodes lie elsewhere."""
    shown, mesh = displayed(model), model.mesh
    span = np.ones(mesh.n_cells, dtype=int) if mesh.span is None else mesh.span.astype(int)
    places = mesh.grid[:, None] + span[:, None, None] * CORNER_OFFSETS
    expected = mesh.origin + mesh.edge * places
    corners = shown.points[shown.cells][:, HEXAHEDRON_CORNERS]
    np.testing.assert_allclose(corners, expected, atol=1e-12)
    volumes = (span * mesh.edge) ** 3
    assert shown.data[DENSITY] @ volumes == pytest.approx(model.mass, rel=1e-9)
    gradient = np.random.default_rng(0).standard_normal((3, 3))
    np.testing.assert_allclose(
        shown.vectors(model.positions @ gradient), shown.points @ gradient, atol=1e-12
    )


def test_a_point_that_hangs_is_there_once():
    """Where one hangs for several elements, and none is a node that is there already."""
    shown = displayed(mixed_model(0)[1])
    hanging = shown.points[shown.interpolation.shape[1] :]
    assert len(hanging) > 0
    assert len(np.unique(hanging.round(9), axis=0)) == len(hanging)


@pytest.mark.parametrize("name", ["voxels", "coarse", "cells"])
def test_meshio_reads_what_the_modes_file_holds(files, name, tmp_path):
    assert main(["vtu", str(files / f"{name}.h5"), "--out", str(tmp_path / "m.vtu")]) == 0
    grid, solution = meshio.read(tmp_path / "m.vtu"), ca.read(files / f"{name}.h5")
    np.testing.assert_array_equal(grid.field_data["frequencies [Hz]"], solution.frequencies)
    np.testing.assert_array_equal(grid.field_data["residuals"], solution.residuals)
    assert len(grid.point_data) == 8
    for number, values in enumerate(grid.point_data.values()):
        moved = voxel_motion(solution.solid, solution.shapes[number].ravel()).reshape(-1, 3)
        np.testing.assert_allclose(values, moved, rtol=1e-12)
    young = solution.solid.young.reshape(solution.mesh.n_cells, -1).mean(axis=1)
    np.testing.assert_allclose(grid.cell_data[YOUNG][0], young)
    assert (grid.cell_data[DENSITY][0] <= 7850.0 * (1.0 + 1e-9)).all()


def test_a_period_is_a_list_of_files_in_which_the_mode_swings(files, tmp_path):
    out = tmp_path / "seven.pvd"
    words = ["--mode", "7", "--frames", "12", "--amplitude", "0.2", "--out", str(out)]
    assert main(["vtu", str(files / "voxels.h5"), *words]) == 0
    sets = ET.parse(out).getroot().findall(".//DataSet")
    assert [float(each.get("timestep")) for each in sets] == pytest.approx(np.arange(12) / 12)
    frames = [meshio.read(tmp_path / each.get("file")) for each in sets]
    solution = ca.read(files / "voxels.h5")
    rest, shape = solution.mesh.nodes, solution.shapes[6]
    np.testing.assert_array_equal(frames[0].points, rest)
    moved = frames[3].points - rest
    longest = np.ptp(rest, axis=0).max()
    assert np.linalg.norm(moved, axis=1).max() == pytest.approx(0.2 * longest)
    scale = np.linalg.norm(moved) / np.linalg.norm(shape)
    np.testing.assert_allclose(moved, scale * shape, atol=1e-9 * longest)
    np.testing.assert_allclose(frames[9].points - rest, -moved, atol=1e-12)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--out", "m.pvd"], "ends in .pvd, expected .vtu"),
        (["--mode", "7", "--out", "m.vtu"], "ends in .vtu, expected .pvd"),
        (["--mode", "9", "--out", "m.pvd"], "found 9, expected the number of one that moves, 1"),
    ],
)
def test_what_cannot_be_written_is_told_and_leaves_nothing(
    files, tmp_path, capsys, words, sentence
):
    *words, name = words
    words = [str(files / "voxels.h5"), *words, str(tmp_path / name)]
    assert main(["vtu", *words]) == EXIT_BAD_INPUT
    assert sentence in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["voxels", "cells"])
def test_a_surface_moves_with_the_solid(files, tmp_path, name):
    out = tmp_path / "s.vtu"
    words = ["vtu", str(files / f"{name}.h5"), "--surface", "builtin:bar", "--out", str(out)]
    assert main(words) == 0
    grid, solution = meshio.read(out), ca.read(files / f"{name}.h5")
    bar, edge = ca.load_mesh("builtin:bar"), solution.mesh.edge
    corners = grid.points[grid.cells_dict["triangle"]]
    sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    assert sides.max() <= edge * (1.0 + 1e-9)
    areas = 0.5 * np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    assert areas.sum() == pytest.approx(bar.surface.area)
    # Rigid motions are linear in the place, and those of the nodes are those of the surface.
    shape, nodes = solution.shapes[0], solution.solid.positions
    linear = np.linalg.lstsq(np.column_stack([nodes, np.ones(len(nodes))]), shape, rcond=None)[0]
    found = next(iter(grid.point_data.values()))
    expected = np.column_stack([grid.points, np.ones(len(grid.points))]) @ linear
    np.testing.assert_allclose(found, expected, atol=1e-6 * abs(shape).max())


def test_a_surface_of_something_else_is_refused(files, tmp_path, capsys):
    words = ["--surface", "builtin:bell", "--out", str(tmp_path / "s.vtu")]
    assert main(["vtu", str(files / "voxels.h5"), *words]) == EXIT_BAD_INPUT
    assert "expected the surface of their solid" in capsys.readouterr().err
