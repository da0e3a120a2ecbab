"""The expected distance from a solid tells of the warping that few cells across do not have."""

import json
from itertools import product

import numpy as np
import pytest
import trimesh

from carillon.fem.finite_cells.build import finite_cells
from carillon.fem.model import RIGID_MODES
from solver.__main__ import main
from solver.accuracy.estimate import estimate_cell_errors
from tests import cut_solids, solids

LENGTH, SIDE = 0.8, 0.1
SHEAR = cut_solids.YOUNG / (2.0 * (1.0 + cut_solids.POISSON))


def triangle():
    """An equilateral prism along the third axis."""
    corners = SIDE * np.array([[0.0, 0.0], [1.0, 0.0], [0.5, np.sqrt(0.75)]])
    points = [[x, y, z] for (x, y), z in product(corners, (0.0, LENGTH))]
    return trimesh.convex.convex_hull(np.array(points))


RODS = {
    # Surface, and the torsion constant over the polar moment of the section (Saint-Venant 1855).
    "square": (cut_solids.box(SIDE, SIDE, LENGTH), 0.1406 * 6.0),
    "two to one": (cut_solids.box(SIDE, SIDE / 2, LENGTH), 0.229 / 8 * 12 / (0.5 + 0.125)),
    "triangle": (triangle(), 48.0 / 80.0),
    "round": (trimesh.creation.cylinder(SIDE / 2, LENGTH, sections=64), 1.0),
    "turned": (cut_solids.turned(cut_solids.box(SIDE, SIDE, LENGTH)), 0.1406 * 6.0),
}


def solved(surface, resolution, modes=16):
    """A model of finite cells and its modes."""
    model = cut_solids.uniform(finite_cells(surface, resolution))
    found = solids.analysed(model, modes=modes, tolerance=1e-6)
    return model, found.values, found.system.gather(found.vectors)


def torsion(surface, model, modes):
    """Number of the mode in which the ends of the rod turn most against each other."""
    axis = np.linalg.eigh(surface.moment_inertia)[1][:, 0]
    arms = model.positions - surface.center_mass
    twist = np.cross(axis, arms) * np.sign(arms @ axis)[:, None]
    turned = twist.ravel() @ modes
    turned[:RIGID_MODES] = 0.0
    return int(np.abs(turned).argmax())


@pytest.mark.parametrize("name", RODS)
@pytest.mark.parametrize("resolution", [16, 32, pytest.param(48, marks=pytest.mark.nightly)])
def test_torsion_is_told_of_one_to_three_cells_across(name, resolution):
    surface, ratio = RODS[name]
    model, values, modes = solved(surface, resolution)
    number = torsion(surface, model, modes)
    exact = np.sqrt(SHEAR * ratio / cut_solids.DENSITY) / (2.0 * LENGTH)
    error = np.sqrt(values[number]) / (2.0 * np.pi) / exact - 1.0
    told = estimate_cell_errors(model, values, modes).errors.errors[number - RIGID_MODES]
    # Saint-Venant's theory itself is 0.2 % off, that of a polygon for a round rod as much.
    assert told >= 0.5 * error - 0.003
    if error > 0.02:
        assert told <= 2.0 * error


def test_bending_of_the_rod_is_told_as_before():
    model, values, modes = solved(cut_solids.box(1.0, 0.025, 0.025), 80, 20)
    told = estimate_cell_errors(model, values, modes).errors
    # Rayleigh-Ritz with these moduli, where quadratic cells have 316.23 Hz.
    assert np.sqrt(values[14]) / (2.0 * np.pi) == pytest.approx(290.43, rel=1e-3)
    assert 0.0 <= told.worst < 1e-3


ROD_HERTZ = np.sqrt(1e9 / 2.5 / 1e3 * 0.1406 * 6.0) / (2.0 * 0.5)
"""Torsion of the rod below."""


@pytest.fixture(scope="module")
def rod(tmp_path_factory):
    """A rod with one cell across at resolution 40."""
    path = tmp_path_factory.mktemp("rod") / "rod.stl"
    cut_solids.box(0.5, 0.025, 0.025).export(path)
    return path


def test_voxels_are_told_their_torsion(rod, tmp_path, capfd):
    out = tmp_path / "modes.h5"
    command = ["modes", str(rod), "--resolution", "40", "--modes", "14", "--json"]
    assert main([*command, "--out", str(out)]) == 0
    summary = json.loads(capfd.readouterr().out)
    hertz = np.array(summary["frequencies_hz"])
    number = int(np.abs(hertz / (1.089 * ROD_HERTZ) - 1.0).argmin())
    assert summary["solid_frequency_error_worst_mode"] == number + 1
    error = hertz[number] / ROD_HERTZ - 1.0
    assert summary["solid_frequency_error_worst"] == pytest.approx(error, rel=0.5)


def test_an_accuracy_that_is_asked_for_is_that_of_torsion_too(rod, tmp_path, capfd):
    out = tmp_path / "modes.h5"
    command = ["modes", str(rod), "--resolution", "40", "--modes", "14", "--accuracy", "0.01"]
    words = ["--discretisation", "finite-cell", "--json", "--out", str(out)]
    assert main([*command, *words]) == 0
    summary = json.loads(capfd.readouterr().out)
    assert summary["solid_frequency_error_rms"] <= 0.01
    assert np.abs(np.array(summary["frequencies_hz"]) / ROD_HERTZ - 1.0).min() < 0.03
