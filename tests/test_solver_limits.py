"""What no machine could bear, or no number hold, is refused before anything is done about it."""

import os
import struct

import numpy as np
import pytest
import trimesh
from mpi4py import MPI

from carillon.errors import UserError
from carillon.fem.geometry import hexmesh_from_grid, load_surface, voxelize
from carillon.fem.model import fine_model
from carillon.fem.regions import Regions
from carillon.processes.petsc import PETSc
from solver.analysis import bounds
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.options import SolverOptions
from solver.analysis.problem import ProblemOptions, build_problem
from solver.linear import petsc_options
from studies.scaling.launch import require_ranks
from tests import solids

BOX = trimesh.creation.box()
OBJ = BOX.export(file_type="obj")


def obj(vertices, faces=BOX.faces):
    lines = ["v " + " ".join(map(repr, map(float, row))) for row in vertices]
    return "\n".join(lines + ["f " + " ".join(map(str, row + 1)) for row in faces])


@pytest.fixture
def mesh(tmp_path):
    """Writes a mesh file."""

    def write(name, content):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return str(path)

    return write


@pytest.mark.parametrize(
    ("vertices", "fault"),
    [
        (BOX.vertices * 1e200, "the longest side is 1e+200 m"),
        (BOX.vertices * 1.7e308, "the longest side is 1.7e+308 m"),
        (BOX.vertices * 3.0e308, "not finite"),
        (BOX.vertices * 1e-200, "the longest side is 1e-200 m"),
        (BOX.vertices * [1e200, 1.0, 1.0], "is flat"),
        (BOX.vertices + 1e15, "too far to tell voxels apart"),
        (BOX.vertices + 1e9, "too far to tell voxels apart"),
        (np.where(BOX.vertices > 0.0, np.inf, 0.0), "not finite"),
    ],
)
def test_surfaces_out_of_all_proportion_are_refused(vertices, fault, mesh):
    with np.errstate(over="ignore"), pytest.raises(UserError) as caught:
        load_surface(mesh("box.obj", obj(vertices)))
    assert fault in str(caught.value)


@pytest.mark.parametrize("offset", [0.0, 1e3, 1e7])
def test_surfaces_away_from_the_origin_are_voxelised(offset, mesh):
    assert voxelize(load_surface(mesh("box.obj", obj(BOX.vertices + offset))), 4).n_cells == 64


@pytest.mark.parametrize("unit", [1e300, 1e-300, 0.0, -1.0, np.nan, np.inf])
def test_units_out_of_range_are_refused(unit):
    with pytest.raises(
        UserError, match="expected a positive number of metres per mesh unit, 1e-12"
    ):
        load_surface("builtin:bar", unit)


def test_a_unit_that_makes_a_solid_too_large_is_refused(mesh):
    with pytest.raises(UserError, match=r"the longest side is 1e\+10 m"):
        load_surface(mesh("box.obj", OBJ), 1e10)


STL, PLY, GLB = (BOX.export(file_type=kind) for kind in ("stl", "ply", "glb"))


@pytest.mark.parametrize(
    ("name", "content"),
    [
        *[(f"empty.{kind}", b"") for kind in ("obj", "stl", "ply", "off", "glb", "gltf")],
        *[(f"byte.{kind}", b"\1") for kind in ("obj", "stl", "ply", "off", "glb", "gltf")],
        ("count.stl", STL[:80] + struct.pack("<I", 2**32 - 1) + STL[84:]),
        ("short.stl", STL[:-10]),
        ("count.ply", PLY.replace(b"element vertex 8", b"element vertex 8000000000000")),
        ("faces.ply", PLY.replace(b"element face 12", b"element face 1200000000000")),
        ("short.ply", PLY[:-10]),
        ("short.glb", GLB[:-10]),
        ("head.glb", GLB[:20]),
        ("count.off", "OFF\n80000000000 12 0\n0 0 0\n"),
        ("range.obj", OBJ + "\nf 1 2 99\n"),
        ("huge.obj", OBJ + "\nf 1 2 9999999999999\n"),
        ("nan.obj", OBJ.replace("v 0.5", "v nan", 1)),
        ("packed.zip", b"PK\5\6" + bytes(18)),
    ],
)
def test_files_that_are_no_meshes_are_refused_in_one_sentence(name, content, mesh):
    with pytest.raises(UserError) as caught:
        load_surface(mesh(name, content))
    assert str(caught.value).count(name) == 1


def test_a_pipe_that_a_mesh_names_is_not_waited_for(mesh, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    assert len(load_surface(mesh("box.obj", "mtllib pipe\n" + OBJ)).faces) == 12


def test_a_needle_thinner_than_voxels_fills_none():
    needle = trimesh.creation.box((1e5, 1.0, 1.0))
    with pytest.raises(UserError, match="fills no voxel"):
        voxelize(needle, 8)


def test_surfaces_that_would_be_cut_into_too_many_triangles_are_refused():
    crumpled = trimesh.util.concatenate([BOX] * 100)
    with pytest.raises(UserError, match="would be cut into .* triangles"):
        voxelize(crumpled, 240)


@pytest.mark.parametrize(
    "options",
    [
        {"density": 1e300},
        {"density": 1e-300},
        {"density": 0.0},
        {"density": np.nan},
        {"poisson": np.nan},
        {"poisson": 1e300},
        {"poisson": -1.0},
        {"unit": 1e300},
        {"resolution": 10**18},
    ],
)
def test_constants_out_of_range_are_refused(options):
    with pytest.raises(UserError):
        build_problem(ProblemOptions(**{"mesh": "builtin:bar", "resolution": 8, **options}))


@pytest.mark.parametrize("unit", [1e-8, 1e8])
@pytest.mark.parametrize("density", [1e-3, 1e6])
@pytest.mark.parametrize("young", [1e-3, 1e15])
def test_solids_at_the_limits_are_solved_as_others_are(unit, density, young):
    """Frequencies scale with the wave speed over the size, whatever the units."""
    grid = np.argwhere(np.ones((4, 2, 2)))

    def frequencies(edge, young, density):
        cells = hexmesh_from_grid(grid, np.zeros(3), edge)
        model = fine_model(
            cells, np.full(cells.n_cells, young), regions=Regions.one(density=density)
        )
        return np.sqrt(solids.analysed(model, modes=12, method="slepc").values[6:])

    scale = np.sqrt(young / density) / unit
    expected = frequencies(1.0, 1.0e9, 1.0e3) / np.sqrt(1e6)
    assert np.allclose(frequencies(unit, young, density) / scale, expected, rtol=1e-8)


def test_modes_that_memory_cannot_hold_are_refused(monkeypatch):
    cells = hexmesh_from_grid(np.argwhere(np.ones((4, 4, 4))), np.zeros(3), 0.1)
    model = fine_model(cells, np.full(cells.n_cells, 1e9))
    monkeypatch.setattr(bounds, "available_memory", lambda: 100_000)
    with pytest.raises(UserError, match="20 modes of 375 unknowns take"):
        ModalSolver(model, SolverOptions(modes=20), MPI.COMM_SELF)


def test_ranks_that_the_cores_cannot_bear_are_refused():
    require_ranks(4, {})
    with pytest.raises(UserError, match="1,000,000 ranks on"):
        require_ranks(1_000_000, {"SLURM_JOB_NUM_NODES": "1000"})


# PETSc --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text", ["", "90", "eps_ncv 90", "-eps_ncv 90", "-carillon_eps_ncv 9 --log_view", "-help"]
)
def test_options_that_are_not_for_this_program_are_refused(text):
    with pytest.raises(
        UserError, match="expected names with the prefix -carillon_, like -carillon_eps_ncv"
    ):
        petsc_options.insert_options(text)


def test_options_that_petsc_never_asked_for_are_known():
    petsc_options.insert_options("-carillon_test_used -3 -carillon_test_misspelt -1e-3")
    options = PETSc.Options()
    try:
        assert options.getInt("carillon_test_used") == -3
        assert petsc_options.unused_options() == ["-carillon_test_misspelt"]
        with pytest.raises(UserError, match="no option -carillon_test_misspelt here"):
            petsc_options.require_known_options()
    finally:
        petsc_options._inserted.clear()
        options.delValue("carillon_test_used")
        options.delValue("carillon_test_misspelt")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("-carillon_eps_ncv abc", "abc has no integer value"),
        ("-carillon_eps_type nonsense", "Unknown EPS type given: nonsense"),
        ("-carillon_eps_nvc 90", "knows no option -carillon_eps_nvc"),
    ],
)
def test_what_petsc_dislikes_is_one_sentence(options, said, tmp_path, run_cli):
    out = tmp_path / "modes.h5"
    solid = ("builtin:bar", "--resolution", "8", "--modes", "8", "--method", "slepc")
    done = run_cli("solver", "modes", *solid, f"--petsc={options}", "--out", out)
    assert done.returncode == 2 and not out.exists()
    assert done.stderr.count("\n") == 1 and said in done.stderr


@pytest.mark.nightly
@pytest.mark.mpi
def test_what_petsc_dislikes_ends_all_ranks(tmp_path, mpiexec):
    solid = ("builtin:bar", "--resolution", "8", "--modes", "8", "--method", "slepc")
    options = "--petsc=-carillon_eps_ncv abc"
    done = mpiexec(2, "solver", "modes", *solid, options, "--out", tmp_path / "modes.h5")
    assert done.returncode != 0 and "Traceback" not in done.stderr
    assert "abc has no integer value" in done.stderr
