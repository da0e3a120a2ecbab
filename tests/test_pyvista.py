"""Pictures by PyVista, and what it is given of meshes and modes."""

import numpy as np
import pytest

import carillon as ca
from solver.response.points import voxel_motion

pyvista = pytest.importorskip("pyvista", reason="PyVista is not installed (requirements-vtk.txt)")


@pytest.fixture(scope="module", params=["voxel", "finite-cell"])
def solution(request) -> ca.Solution:
    how = {"resolution": 8, "modes": 8, "discretisation": request.param}
    return ca.solve("builtin:bar", "two-region", **how)


def test_a_grid_is_the_solid_in_its_modes(solution):
    grid = solution.to_pyvista()
    assert grid.n_cells == solution.mesh.n_cells
    np.testing.assert_allclose(grid.volume, solution.mesh.volume, rtol=1e-6)
    for number, shape in enumerate(solution.shapes, 1):
        moved = voxel_motion(solution.solid, shape.ravel()).reshape(-1, 3)
        np.testing.assert_allclose(grid.point_data[f"mode {number}"], moved, rtol=1e-12)
    hertz = grid.field_data["frequencies [Hz]"]
    np.testing.assert_array_equal(hertz, solution.frequencies)


def test_a_mesh_keeps_its_triangles():
    mesh = ca.load_mesh("builtin:bell")
    made = mesh.to_pyvista()
    assert made.n_cells == len(mesh.faces)
    np.testing.assert_allclose(made.area, mesh.surface.area, rtol=1e-6)


def test_a_picture_is_written_without_a_screen(solution, tmp_path):
    plotter = solution.plot(mode=7, path=tmp_path / "bar.png", by="pyvista")
    assert isinstance(plotter, pyvista.Plotter)
    pixels = pyvista.read(tmp_path / "bar.png").point_data.active_scalars
    assert len(np.unique(pixels, axis=0)) > 100
    with pytest.raises(ca.UserError, match="expected a name that ends in one of .png"):
        solution.plot(7, tmp_path / "bar.txt", by="pyvista")
    assert [each.name for each in tmp_path.iterdir()] == ["bar.png"]
