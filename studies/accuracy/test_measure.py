"""References that no mesh made agree with theory; discretisations approach them at their rates."""

import json
import sys

import numpy as np
import pytest

from solver.__main__ import main
from studies.accuracy import domains, tetrahedra
from studies.accuracy.measure import as_text, summarised
from studies.accuracy.ritz import free_eigenvalues
from studies.accuracy.solids import DENSITY, POISSON, SOLIDS, YOUNG
from tests import solids, theories


def frequencies(domain, degrees, poisson=POISSON):
    values = free_eigenvalues(domain, degrees, YOUNG, poisson, DENSITY)
    return np.sqrt(values[6:]) / (2.0 * np.pi)


def test_a_sphere_sounds_as_lamb_says():
    found = SOLIDS["sphere"].frequencies(30)
    exact = theories.sphere_frequencies(0.1, YOUNG, POISSON, DENSITY, 1.05 * found[-1])
    assert np.allclose(found, exact[:30], rtol=1e-6)


def test_a_slender_box_bends_as_timoshenko_says():
    degrees = (14, 4, 4)
    found = frequencies(domains.box((0.5, 0.02, 0.02), degrees), degrees)[:4]
    exact = solids.timoshenko_free_frequencies(0.5, 0.02, YOUNG, POISSON, DENSITY, 2)
    assert np.allclose(found.reshape(2, 2), exact[:, None], rtol=1e-3)


def test_a_thin_box_sounds_as_a_plate():
    degrees = (14, 14, 4)
    found = frequencies(domains.box((0.4, 0.4, 0.004), degrees), degrees, 0.3)[:4]
    assert np.allclose(found, theories.plate_frequencies(0.4, 0.004, YOUNG, DENSITY), rtol=3e-3)


def test_a_thin_tube_bends_as_a_ring():
    degrees, section = (14, 14, 2), 0.005
    sides = (0.2 + section, 0.2 + section, section)
    domain = domains.cylinder(sides, degrees, bore=(0.2 - section) / (0.2 + section))
    found = frequencies(domain, degrees)
    for exact in theories.ring_frequencies(0.1, section, YOUNG, DENSITY, 3):
        assert np.count_nonzero(np.abs(found / exact - 1.0) < 0.01) >= 2


def test_a_hollow_sphere_of_no_hollow_is_a_sphere():
    degrees = (6, 6, 6)
    whole, hollow = (domains.ellipsoid((2.0, 1.0, 1.0), degrees, bore) for bore in (0.0, 1e-9))
    assert np.allclose(frequencies(whole, degrees), frequencies(hollow, degrees), rtol=1e-6)


@pytest.mark.parametrize("shape", ["cylinder", "ellipsoid"])
def test_references_fall_as_degrees_rise(shape):
    make = getattr(domains, shape)
    low, high = (
        frequencies(make((0.2, 0.15, 0.1), degrees), degrees)[:20]
        for degrees in ((6, 6, 6), (8, 8, 8))
    )
    assert (high <= low * (1.0 + 1e-9)).all() and (high < 0.999 * low).any()


@pytest.mark.parametrize("name", SOLIDS)
def test_surfaces_are_those_of_the_references(name):
    """Volume and moment of inertia about the middle, which no turn changes."""
    solid = SOLIDS[name]
    domain = solid.domain((2, 2, 2))
    surface = solid.surface()
    inertia = domain.weights @ (domain.points**2).sum(axis=1)
    assert surface.volume == pytest.approx(domain.weights.sum(), rel=1e-6)
    assert 0.5 * np.trace(surface.moment_inertia) == pytest.approx(inertia, rel=1e-3)
    assert surface.is_watertight and np.allclose(surface.center_mass, 0.0, atol=1e-9)


def level(kind: str, spacing: float, unknowns: int, seconds: float, rms: float) -> dict:
    sizes = {"spacing": spacing, "unknowns": unknowns, "seconds": seconds}
    return {"solid": "block", "discretisation": kind, "rms": rms, **sizes}


def test_errors_are_told_at_equal_unknowns_and_at_equal_time():
    levels = [
        level("finite-cell", 0.04, 1000, 1.0, 0.08),
        level("finite-cell", 0.02, 8000, 4.0, 0.01),
        level("voxel", 0.04, 1000, 0.5, 0.4),
        level("voxel", 0.02, 16000, 2.0, 0.1),
        {"solid": "block", "discretisation": "linear tetrahedra", "problem": "none"},
    ]
    cells, voxels, nothing = summarised(levels)
    assert (cells["rate"], voxels["rate"]) == (pytest.approx(3.0), pytest.approx(2.0))
    assert (cells["unknowns"], cells["seconds"]) == (1000, 1.0)
    assert cells["error_at_unknowns"] == pytest.approx(0.08)
    assert voxels["error_at_unknowns"] == pytest.approx(0.4)
    assert voxels["error_at_seconds"] == pytest.approx(0.2)
    assert nothing["rate"] is None and nothing["error_at_unknowns"] is None


@pytest.fixture(scope="module")
def measured(tmp_path_factory):
    """What the command writes of the coarsest models of the sphere."""
    out = tmp_path_factory.mktemp("accuracy") / "sphere.json"
    words = ["--solids", "sphere", "--levels", "2", "--runs", "1", "--out", str(out)]
    assert main(["accuracy", *words]) == 0
    return json.loads(out.read_text())


def test_finite_cells_come_nearer_and_faster_than_voxels(measured):
    errors = {}
    for found in measured["levels"]:
        errors.setdefault(found["discretisation"], []).append(found["rms"])
        assert found["seconds"] == found["build_seconds"] + found["solve_seconds"] > 0.0
    assert errors["finite-cell"][1] < 0.01 < errors["voxel"][1]
    rates = {row["discretisation"]: row["rate"] for row in measured["summary"]}
    assert rates["finite-cell"] > 1.8 > rates["voxel"]
    assert measured["references"]["sphere"]["change"] < 1e-6


def test_the_command_tells_what_it_found(measured):
    text = as_text(measured)
    assert "Sphere of 20 cm; reference to 1e-07" in text
    assert text.count("finite-cell") == 3 and text.count("voxel") == 3


def test_without_the_packages_there_is_a_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "gmsh", None)
    assert tetrahedra.missing().startswith("Without tetrahedra: gmsh cannot be loaded (")
    assert tetrahedra.missing().endswith("requirements-tetrahedra.txt.")


@pytest.mark.skipif(bool(tetrahedra.missing()), reason=tetrahedra.missing())
def test_quadratic_tetrahedra_have_curved_faces():
    solid = SOLIDS["sphere"]
    K, M = tetrahedra.matrices(*tetrahedra.mesh(solid, 0.04, 2))
    motion = np.tile([1.0, 0.0, 0.0], K.shape[0] // 3)
    volume = motion @ M @ motion / DENSITY
    assert volume == pytest.approx(np.pi / 6.0 * 0.2**3, rel=1e-3)
    assert np.abs(K @ motion).max() < 1e-9 * abs(K).max()


def test_unknown_solids_get_one_sentence(refuses):
    assert "expected some of block" in refuses(main, "accuracy", "--solids", "block,cube")
