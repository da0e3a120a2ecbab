"""K and M in files of other programs: the numbers that Carillon itself solves with."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.io import mmread
from scipy.sparse.linalg import eigsh

import carillon as ca
from carillon.command_line.exit_status import EXIT_BAD_INPUT
from carillon.fem.finite_cells.build import covering
from carillon.fem.geometry import builtin_surface
from carillon.processes.petsc import PETSc
from solver.__main__ import main
from solver.assembly.sparse import assembled
from solver.exchange.matrices import matrices
from tests import solids
from tests.cut_solids import divided, uniform
from tests.test_refinement import mixed_model

SOLID = ["builtin:bar", "--resolution", "8", "--material", "two-region"]


def petsc(path):
    viewer = PETSc.Viewer().createBinary(str(path), "r", comm=PETSc.COMM_SELF)
    indptr, indices, data = PETSc.Mat().load(viewer).getValuesCSR()
    return sp.csr_matrix((data, indices, indptr))


READERS = {"mtx": mmread, "petsc": petsc, "npz": sp.load_npz}


@pytest.fixture(scope="module")
def solution(tmp_path_factory):
    path = tmp_path_factory.mktemp("modes") / "bar.h5"
    assert main(["modes", *SOLID, "--modes", "12", "--tolerance", "1e-9", "--out", str(path)]) == 0
    return path


@pytest.mark.parametrize("ending", READERS)
def test_another_solver_finds_the_same_eigenvalues_in_files(solution, tmp_path, ending):
    names = {each: str(tmp_path / f"{each}.{ending}") for each in ("stiffness", "mass")}
    words = [word for name, path in names.items() for word in (f"--{name}", path)]
    assert main(["matrices", *SOLID, *words]) == 0
    K, M = (sp.csc_matrix(READERS[ending](path)) for path in names.values())
    expected = ca.read(solution).eigenvalues
    shift = -0.1 * expected[6]
    found = np.sort(eigsh(K, 12, M, sigma=shift, return_eigenvectors=False))
    np.testing.assert_allclose(found[6:], expected[6:], rtol=1e-8)
    np.testing.assert_allclose(found[:6], 0.0, atol=1e-8 * expected[6])


def test_rows_are_components_of_the_nodes_that_are_written(solution, tmp_path):
    """A rotation about the origin has no energy, and the mass of a translation is the solid's."""
    words = [f"--{each}={tmp_path / each}.npz" for each in ("stiffness", "mass")]
    assert main(["matrices", str(solution), *words, f"--nodes={tmp_path / 'nodes.npy'}"]) == 0
    K, M = (sp.load_npz(tmp_path / f"{each}.npz") for each in ("stiffness", "mass"))
    nodes = np.load(tmp_path / "nodes.npy")
    np.testing.assert_array_equal(nodes, ca.read(solution).solid.positions)
    turned = np.cross([0.3, -0.2, 0.9], nodes).ravel()
    assert abs(K @ turned).max() < 1e-12 * abs(K).max() * abs(turned).max()
    along_y = np.tile([0.0, 1.0, 0.0], len(nodes))
    assert along_y @ M @ along_y == pytest.approx(ca.read(solution).solid.mass)


@pytest.mark.parametrize(
    "model",
    [
        solids.random_box(3, 2, 2),
        mixed_model(0)[1],
        uniform(divided(covering(builtin_surface("bell"), 10), (0.3, 0.1))),
    ],
    ids=["voxels", "mixed", "finite cells"],
)
def test_matrices_are_those_of_the_solid_in_the_order_of_its_nodes(model):
    for found, expected in zip(matrices(model), assembled(model), strict=True):
        assert abs(found - expected).max() <= 1e-12 * abs(expected).max()
        assert abs(found - found.T).max() <= 1e-12 * abs(found).max()


def test_the_public_function_takes_what_solve_takes():
    K, M = ca.matrices("builtin:bar", 2e9, resolution=8)
    solid = ca.solve("builtin:bar", 2e9, resolution=8, modes=8).solid
    for found, expected in zip((K, M), ca.matrices(solid), strict=True):
        assert (found != expected).nnz == 0


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ([*SOLID], "expected --stiffness, --mass or --nodes"),
        ([*SOLID, "--mass", "M.txt"], "ends in .txt, expected .mtx (Matrix Market)"),
        ([*SOLID, "--nodes", "nodes.txt"], "expected a name that ends in .npy"),
        ([*SOLID, "--mass", "M.mtx", "--stiffness", "M.mtx"], "expected names that differ"),
        (["builtin:bar", "--mass", "M.mtx"], "expected --resolution of a mesh"),
        (["bar.h5", "--density", "8000", "--mass", "M.mtx"], "leave out --density"),
    ],
)
def test_a_mistake_is_told_in_one_sentence(tmp_path, monkeypatch, capsys, words, sentence):
    monkeypatch.chdir(tmp_path)
    assert main(["matrices", *words]) == EXIT_BAD_INPUT
    assert sentence in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
