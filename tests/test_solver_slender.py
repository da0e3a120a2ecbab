"""Six rigid motions are told from slow elastic ones, however slender the solid."""

import json

import numpy as np
import pytest
from mpi4py import MPI

from carillon.errors import ConvergenceError
from carillon.fem.finite_cells.build import finite_cells
from carillon.fem.model import RIGID_MODES, fine_model
from solver.__main__ import main
from solver.files.modes_file import write_modes
from solver.verification.audit import audit_files
from solver.verification.residuals import count_rigid
from studies.accuracy import domains
from studies.accuracy.ritz import free_eigenvalues
from tests import cut_solids, solids

COMM = MPI.COMM_SELF
METHODS = ("auto", "slepc", "hcms")
FEW = (7, 8, 10, 14)


@pytest.fixture(scope="module")
def voxel_wires():
    """Two voxels thick, up to 400 times as long."""
    return {ratio: solids.uniform_box(2 * ratio, 2, 2, 0.5 / ratio) for ratio in (50, 400)}


@pytest.fixture(scope="module")
def slender_cells():
    """Wires and a plate of finite cells."""
    solid = {
        "wire 50:1": finite_cells(cut_solids.box(1.0, 0.02, 0.02), 50),
        "wire 400:1": finite_cells(cut_solids.box(1.0, 0.0025, 0.0025), 400),
        "plate 200:1": finite_cells(cut_solids.box(0.2, 0.2, 0.001), 12),
    }
    return {name: cut_solids.uniform(cells) for name, cells in solid.items()}


def counted(model, method, modes):
    """Rigid modes of those found."""
    return solids.analysed(model, modes=modes, method=method).evidence["rigid_modes"]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("ratio", [50, pytest.param(400, marks=pytest.mark.nightly)])
def test_a_wire_of_voxels_has_six_rigid_modes(voxel_wires, ratio, method):
    for modes in FEW if ratio == 50 else (7, 10):
        assert counted(voxel_wires[ratio], method, modes) == RIGID_MODES


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "name",
    ["wire 50:1", "plate 200:1", pytest.param("wire 400:1", marks=pytest.mark.nightly)],
)
def test_slender_finite_cells_have_six_rigid_modes(slender_cells, name, method):
    for modes in FEW if name == "wire 50:1" else (7, 10):
        assert counted(slender_cells[name], method, modes) == RIGID_MODES


@pytest.mark.nightly
def test_a_wire_has_six_rigid_modes_among_many(voxel_wires):
    assert counted(voxel_wires[400], "auto", 200) == RIGID_MODES


@pytest.mark.parametrize("words", [[], ["--discretisation", "finite-cell"]])
def test_the_command_tells_the_frequencies_of_a_wire(words, tmp_path, capfd):
    mesh, out = tmp_path / "wire.stl", tmp_path / "modes.h5"
    cut_solids.box(1.0, 0.005, 0.005).export(mesh)
    command = ["modes", str(mesh), "--resolution", "400", "--modes", "10", "--no-estimate"]
    assert main([*command, *words, "--json", "--out", str(out)]) == 0
    summary = json.loads(capfd.readouterr().out)
    assert summary["rigid_modes"] == RIGID_MODES
    # Rayleigh-Ritz; two voxels bend 6 % too stiffly.
    exact = np.array([5.139, 5.139, 14.164, 14.164])
    error = summary["frequencies_hz"][RIGID_MODES:] / exact - 1.0
    assert (np.abs(error) < 1e-3).all() if words else ((0.05 < error) & (error < 0.07)).all()


def test_the_reference_of_the_wire_is_a_ritz_solution():
    degrees = (14, 4, 4)
    domain = domains.box((1.0, 0.005, 0.005), degrees)
    values = free_eigenvalues(domain, degrees, 1e9, 0.25, 1000.0)[RIGID_MODES : RIGID_MODES + 4]
    assert np.allclose(np.sqrt(values) / (2.0 * np.pi), [5.139, 5.139, 14.164, 14.164], rtol=1e-3)


def hinged():
    """Two blocks that share an edge alone."""
    block = solids.box_mesh(4, 4, 4).grid
    mesh = solids.hexmesh_from_grid(np.concatenate([block, block + [4, 4, 0]]), np.zeros(3), 0.01)
    return fine_model(mesh, np.full(mesh.n_cells, 1e9))


@pytest.mark.parametrize("modes", [8, 20])
@pytest.mark.parametrize("method", METHODS)
def test_a_hinge_is_told_however_few_the_modes(method, modes):
    with pytest.raises(ConvergenceError, match="7 zero-frequency modes found"):
        counted(hinged(), method, modes)


@pytest.mark.parametrize("method", METHODS)
def test_a_wire_with_a_hinge_amid_is_refused(method):
    half = solids.box_mesh(40, 2, 2).grid
    mesh = solids.hexmesh_from_grid(np.concatenate([half, half + [40, 2, 0]]), np.zeros(3), 0.01)
    with pytest.raises(ConvergenceError, match="7 zero-frequency modes found"):
        counted(fine_model(mesh, np.full(mesh.n_cells, 1e9)), method, 10)


def test_an_audit_counts_the_same(voxel_wires, tmp_path):
    model, path = voxel_wires[50], tmp_path / "wire.h5"
    found = solids.analysed(model, modes=8)
    write_modes(path, model, found.values, [found.vectors], found.residuals, {}, {})
    assert audit_files([path])["wire"].rigid_modes == RIGID_MODES


def test_slow_motions_count_as_zero_only_beside_what_smooth_ones_would_do():
    values = np.array([1e-6] * 6 + [1.0, 2.0, 1e10])
    scales = np.full(9, 1e10)
    assert count_rigid(values, scales, lambda: 1e8) == 8
    assert count_rigid(values, scales, lambda: 1e3) == 6
    assert count_rigid(values[:8], scales[:8], lambda: pytest.fail("nothing is slow")) == 6
