"""Discretisations compared: lattices that nest, one material on all, truths, the command."""

import json
from itertools import product

import numpy as np
import pytest

from carillon.fem.geometry import builtin_surface, hexmesh_from_grid
from carillon.fem.geometry.grid import Grid
from solver.accuracy.material import HARMONIC, PlacedMaterial
from solver.accuracy.voxels import covering_on, voxel_lattice
from studies.discretisation.methods import TimedSpectrum, scaled, voxel_mesh
from studies.discretisation.truth import truth_between

LATTICE = Grid(np.array([0.1, 0.2, 0.3]), 0.01, (8, 4, 4))


def mesh_on(lattice: Grid, *, inside=lambda grid: np.ones(len(grid), dtype=bool)):
    """Mesh of the voxels of a lattice that are inside."""
    grid = np.array(list(product(*map(range, lattice.shape))))
    return hexmesh_from_grid(grid[inside(grid)], np.asarray(lattice.origin), lattice.edge)


@pytest.fixture(scope="module")
def noise() -> PlacedMaterial:
    """A material whose voxels beyond x = 5 are outside the solid."""
    mesh = mesh_on(LATTICE, inside=lambda grid: grid[:, 0] < 5)
    young = np.random.default_rng(0).uniform(1.0, 9.0, mesh.n_cells)
    return PlacedMaterial.of_voxels(LATTICE, mesh, young, interpolated=False)


def test_voxels_and_cells_lie_on_one_lattice():
    surface = builtin_surface("bell")
    lattice = voxel_lattice(surface, 14)
    mesh = voxel_mesh(surface, 14, "error", "bell")
    assert np.allclose(mesh.origin, lattice.origin) and mesh.edge == pytest.approx(lattice.edge)
    assert (mesh.grid.max(axis=0) < lattice.shape).all()
    assert all(size % 4 == 0 for size in lattice.shape)
    half = covering_on(surface, scaled(lattice, 0.5), "error", "bell").cells
    assert np.allclose(half.mesh.origin, lattice.origin)
    assert half.mesh.edge == pytest.approx(2.0 * lattice.edge)


def test_each_voxel_keeps_its_modulus_on_finer_lattices(noise):
    mesh = mesh_on(LATTICE)
    of_voxel = dict(zip(map(tuple, mesh.grid), noise.on(mesh), strict=True))
    finer = mesh_on(scaled(LATTICE, 2))
    for place, young in zip(finer.grid, noise.on(finer), strict=True):
        assert young == of_voxel[tuple(place // 2)]


def test_voxels_outside_have_the_modulus_of_the_nearest_inside(noise):
    young = noise.on(mesh_on(LATTICE)).reshape(4, 4, 8)
    assert (young[:, :, 5:] == young[:, :, 4:5]).all()


def test_joined_voxels_have_means_over_those_inside(noise):
    values = noise.young
    mesh = mesh_on(scaled(LATTICE, 0.5))
    blocks = dict(zip(map(tuple, mesh.grid), noise.on(mesh), strict=True))
    assert blocks[0, 0, 0] == pytest.approx(values[:2, :2, :2].mean())
    assert blocks[2, 1, 1] == pytest.approx(values[4, 2:, 2:].mean())
    assert blocks[3, 0, 0] == pytest.approx(values[6:, :2, :2].mean())
    harmonic = noise.on(mesh, HARMONIC)
    assert (harmonic < np.array(list(blocks.values()))).all()
    assert harmonic[0] == pytest.approx(1.0 / np.mean(1.0 / values[:2, :2, :2]))


def test_a_smooth_material_is_the_same_function_on_all_lattices():
    def young(mesh):
        return np.exp((mesh.origin + mesh.edge * (mesh.grid + 0.5)) @ [20.0, -10.0, 5.0])

    mesh = mesh_on(LATTICE)
    material = PlacedMaterial.of_voxels(LATTICE, mesh, young(mesh), interpolated=True)
    assert np.allclose(material.on(mesh), young(mesh))
    half = mesh_on(scaled(LATTICE, 0.5))
    assert np.allclose(material.on(half), young(half))
    finer = mesh_on(scaled(LATTICE, 2))
    inner = ((finer.grid > 0) & (finer.grid < np.array(scaled(LATTICE, 2).shape) - 1)).all(axis=1)
    assert np.allclose(material.on(finer)[inner], young(finer)[inner])


def test_the_truth_lies_between_the_finest_and_what_may_be_left():
    spectra = [
        TimedSpectrum(np.array([*[0.0] * 6, *hertz]), 30, {})
        for hertz in ([104.0, 250.0], [100.0] * 2)
    ]
    truth = truth_between(*spectra, left=1.0)
    assert truth["frequencies_hz"] == pytest.approx([25.0, 98.0])
    assert truth["doubt_rms"] == pytest.approx(np.sqrt((0.02**2 + 0.75**2) / 2.0))
    assert truth["doubt_worst"] == pytest.approx(0.75)


@pytest.fixture(scope="module")
def plate(tmp_path_factory, run_cli):
    """What the command writes of a plate with noise, and prints."""
    path = tmp_path_factory.mktemp("plate") / "case.json"
    command = ["discretisation", "builtin:plate", "--resolution", 12, "--material", "noise"]
    done = run_cli("solver", *command, "--modes", 12, "--runs", 1, "--out", path, check=True)
    return json.loads(path.read_text()), done.stdout


def test_every_way_is_rated_against_both_truths(plate):
    case, printed = plate
    ways = case["ways"]
    assert list(ways) == [
        "voxels",
        "coarse",
        "refined",
        "half-cells",
        "half-cells-divided",
        "half-cells-harmonic",
        "cells",
    ]
    assert ways["voxels"]["against"]["voxels"]["rms"] == 0.0
    for name, way in ways.items():
        assert f"\n{name} " in printed
        assert way["against"]["solid"]["last"] == 12 and len(way["frequencies_hz"]) == 6
        assert way["seconds"] == pytest.approx(sum(way["phases"].values()))
        assert way["spread"]["min"] == way["spread"]["max"] == way["seconds"]
    assert ways["coarse"]["n_dofs"] < ways["voxels"]["n_dofs"]
    assert ways["half-cells"]["n_dofs"] < ways["cells"]["n_dofs"] < case["truth"]["n_dofs"]
    harmonic, arithmetic = (
        np.array(ways[name]["frequencies_hz"]) for name in ("half-cells-harmonic", "half-cells")
    )
    assert (harmonic < arithmetic).all()
    # Means and cells of whole voxels can only be too stiff, and the finest ones least.
    assert (arithmetic > case["truth"]["finest_hz"]).all()
    assert case["provenance"]["commit"]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--modes", "6"], "found 6, expected at least 7"),
        (["--runs", "0"], "found 0, expected at least 1"),
        (["--lumped"], "unrecognized arguments: --lumped"),
        (["--poisson", "-0.3"], "the default forests are for Poisson's ratios 0 to 0.49"),
        (["--out", "absent/case.json"], "the folder absent does not exist"),
    ],
)
def test_bad_arguments_are_answered_in_one_sentence(arguments, sentence, run_cli):
    done = run_cli("solver", "discretisation", "builtin:box", "--resolution", "8", *arguments)
    assert done.returncode == 2
    assert sentence in done.stderr
    assert done.stderr.count("\n") == 1
