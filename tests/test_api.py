"""The public surface, `import carillon as ca`: whole, light, and the same as what it stands on."""

import h5py
import meshio
import numpy as np
import pytest

import carillon as ca
from carillon import api
from carillon.fem.geometry import HexMesh
from tests.programs import CHECKOUT, python


@pytest.fixture(scope="module")
def bar() -> ca.Solution:
    return ca.solve("builtin:bar", "two-region", resolution=12, modes=12)


def test_all_names_are_there_and_documented():
    page = (CHECKOUT / "docs" / "reference" / "api.md").read_text()
    for name in ca.__all__:
        assert getattr(ca, name).__doc__
        assert f"carillon.{name}\n" in page


def test_import_loads_no_room_and_no_numpy():
    program = "import sys, carillon as ca; ca.UserError; print(*sys.modules)"
    done = python("-c", program)
    loaded = {name.partition(".")[0] for name in done.stdout.split()}
    assert loaded.isdisjoint({"numpy", "mpi4py", "petsc4py", "numba", "solver", "sound", "forests"})


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'Bell'"):
        ca.Bell  # noqa: B018


def test_a_mesh_of_arrays_is_that_of_its_file():
    read = ca.load_mesh("builtin:bell", unit=2.0)
    made = ca.Mesh.of_triangles(read.vertices, read.faces)
    assert np.array_equal(made.hexahedra(12).cells, read.hexahedra(12).cells)


@pytest.mark.parametrize("faces", [[[0, 1, 9]], np.empty((0, 3)), [[0, 1, 2]]])
def test_arrays_that_are_no_solid_are_refused(faces):
    with pytest.raises(ca.UserError):
        ca.Mesh.of_triangles([[0, 0, 0], [1, 0, 0], [0, 1, 0]], faces, "flat")


@pytest.mark.parametrize(
    "young",
    [2e9, "two-region", lambda centres: 1e9 + centres[:, 0] * 1e9, np.array(3e9)],
    ids=["number", "name", "function", "array"],
)
def test_moduli_are_positive_and_one_a_voxel(young):
    mesh = ca.load_mesh("builtin:bar").hexahedra(12)
    moduli = ca.Material(young).moduli(mesh)
    assert moduli.shape == (mesh.n_cells,) and (moduli > 0.0).all()


def test_a_modulus_alone_keeps_the_constants_of_a_solid(bar):
    solid = ca.solve("builtin:bar", ca.Material.named("steel"), resolution=8, modes=8).solid
    again = ca.solve(solid, 2.0 * solid.young, modes=8).solid
    assert (again.density, again.poisson) == (7850.0, solid.poisson)


def test_a_solution_is_the_same_after_its_file(bar, tmp_path):
    bar.save(tmp_path / "bar.h5")
    read = ca.read(tmp_path / "bar.h5")
    assert np.array_equal(read.shapes, bar.shapes)
    assert np.array_equal(read.frequencies, bar.frequencies)
    assert ca.compare(read, bar).eigenvalue_relative_error["max"] == 0.0
    assert ca.audit(tmp_path / "bar.h5").faults == []
    with h5py.File(tmp_path / "bar.h5") as file:
        assert file["modes"].shape == (bar.mesh.n_dofs, 12)


def test_paraview_is_given_every_mode_and_hexahedra_that_are_right_way_out(bar, tmp_path):
    bar.to_vtu(tmp_path / "bar.vtu")
    grid = meshio.read(tmp_path / "bar.vtu")
    assert len(grid.point_data) == 12
    corners = grid.points[grid.cells_dict["hexahedron"]]
    sides = [corners[:, k] - corners[:, 0] for k in (1, 3, 4)]
    volumes = np.einsum("ci,ci->c", np.cross(sides[0], sides[1]), sides[2])
    assert volumes.sum() == pytest.approx(bar.mesh.volume)
    shape = next(values for name, values in grid.point_data.items() if name.startswith("mode 7,"))
    assert np.allclose(shape, bar.shapes[6])


def test_a_figure_says_its_mode(bar):
    assert bar.plot(7).axes[0].get_title().startswith("mode 7, ")
    with pytest.raises(ca.UserError, match="expected 1 to 12"):
        bar.plot(13)


def test_finite_cells_are_solved_drawn_and_written(tmp_path):
    cells = ca.solve("builtin:bar", resolution=8, modes=8, discretisation="finite-cell")
    cells.plot(7)
    cells.to_vtu(tmp_path / "cells.vtu")
    assert ca.audit(cells).faults == []


def test_two_strikes_are_the_sum_of_each(bar):
    at = bar.mesh.nodes[[0, -1]]
    both = ca.render(bar, at, times=[0.0, 0.1], seconds=0.4)
    first, second = (ca.render(bar, each, seconds=0.4) for each in at)
    delay = round(0.1 * api.SAMPLE_RATE)
    basis = np.stack([first, np.concatenate([np.zeros(delay), second[:-delay]])])
    assert np.linalg.lstsq(basis.T, both, rcond=None)[1][0] < 1e-12 * both @ both


def test_a_point_or_a_target_is_needed(bar):
    with pytest.raises(ca.UserError, match="expected at"):
        ca.render(bar)


def test_a_design_sounds_as_its_clip_and_is_exported(tmp_path):
    seconds = np.arange(4000) / 8000
    partials = [np.sin(2.0 * np.pi * hertz * seconds) for hertz in (700.0, 1300.0)]
    ca.write_wav(tmp_path / "clip.wav", 0.3 * np.exp(-6.0 * seconds) * np.sum(partials, 0), 8000)
    found = ca.design(
        mesh="builtin:bar",
        resolution=8,
        coarsen="none",
        material={"dimensions": 4},
        targets=[{"name": "end", "vertex": 0, "clip": str(tmp_path / "clip.wav")}],
        optimiser={"evaluations": 4, "workers": 1},
    )
    assert len(found.frequencies) == len(found.target_frequencies)
    assert np.abs(found.render(target="end", seconds=0.1)).max() > 0.0
    found.export(tmp_path / "moduli.npy")
    assert np.array_equal(np.load(tmp_path / "moduli.npy").ravel(), found.young)
    found.save(tmp_path / "design.h5")
    assert np.array_equal(ca.read(tmp_path / "design.h5").young, found.young)


def test_forests_are_trained_and_coarsen_a_solid(tmp_path):
    ca.generate(tmp_path / "shard.h5", 400, seed=1)
    forests = ca.train([tmp_path / "shard.h5"], tmp_path / "forests.h5", trees=1, min_leaf=10)
    assert forests.scores
    solid = ca.coarsen("builtin:bar", resolution=12, forests=forests)
    assert isinstance(solid.mesh, HexMesh) and solid.n_dofs < 3 * 68


@pytest.mark.mpi
def test_ranks_solve_together(tmp_path, bar, mpiexec):
    script = tmp_path / "script.py"
    script.write_text(
        "import carillon as ca\n"
        "found = ca.solve('builtin:bar', 'two-region', resolution=12, modes=12)\n"
        f"found.save({str(tmp_path / 'bar.h5')!r})\n"
        "print(len(found.frequencies))\n"
    )
    assert mpiexec(2, script, check=True).stdout.split() == ["12", "12"]
    assert ca.compare(ca.read(tmp_path / "bar.h5"), bar).eigenvalue_relative_error["max"] < 1e-6
