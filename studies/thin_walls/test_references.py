"""References agree with theory, and the file with what its command computes."""

import sys

import numpy as np
import pytest

from carillon.__main__ import main
from carillon.errors import UserError
from carillon.fem.geometry.builtin import builtin_surface
from studies.accuracy import domains
from studies.accuracy.ritz import free_eigenvalues
from studies.accuracy.solids import DENSITY, POISSON, YOUNG
from studies.accuracy.tetrahedra import missing
from studies.thin_walls import profiles, references_command
from studies.thin_walls.catalogue import NAMES
from studies.thin_walls.harmonics import harmonic_frequencies
from studies.thin_walls.profiles import Profile, profile_of
from studies.thin_walls.references import (
    COUNT,
    POLYNOMIALS,
    StoredReference,
    compute_reference,
    read_references,
    write_references,
)
from studies.thin_walls.solids import SOLIDS, TURNED, WalledSolid
from studies.thin_walls.tetrahedra import mesh, quadratic_tetrahedra
from tests import theories

needs_gmsh = pytest.mark.skipif(bool(missing()), reason=missing())
DOUBT = 4e-3
"""Largest doubt that a reference may have."""


@pytest.fixture(scope="module")
def sphere() -> Profile:
    """A sphere of 0.1 m; its polygon encloses the volume."""
    angle = np.linspace(0.0, np.pi, 101)
    points = 0.1 * np.column_stack([np.sin(angle), -np.cos(angle)])
    points[[0, -1], 0] = 0.0
    r, z = points.T
    volume = np.pi / 3.0 * np.sum(np.diff(z) * (r[1:] ** 2 + r[1:] * r[:-1] + r[:-1] ** 2))
    return Profile(points * np.cbrt(4.0 / 3.0 * np.pi * 0.1**3 / volume))


@needs_gmsh
def test_a_sphere_sounds_as_lamb_says(sphere):
    found = harmonic_frequencies(sphere, 0.02, 30)
    exact = theories.sphere_frequencies(0.1, YOUNG, POISSON, DENSITY, 1.05 * found[-1])
    assert np.allclose(found, exact[:30], rtol=1e-4)


@needs_gmsh
def test_a_cylinder_twists_as_theory_says():
    radius, length = 0.02, 0.2
    rod = Profile(np.array([(0.0, 0.0), (radius, 0.0), (radius, length), (0.0, length)]))
    found = harmonic_frequencies(rod, 0.005, 12)
    first = np.sqrt(0.5 * YOUNG / (1.0 + POISSON) / DENSITY) / (2.0 * length)
    for torsion in (first, 2.0 * first):
        assert np.abs(found / torsion - 1.0).min() < 1e-5


@needs_gmsh
def test_harmonics_polynomials_and_tetrahedra_agree():
    ring = profiles.ring(wall=0.02)
    found = harmonic_frequencies(ring, 0.005, 8)
    degrees = (14, 14, 8)
    whole = domains.cylinder((0.2, 0.2, 0.06), degrees, bore=0.8)
    of_polynomials = free_eigenvalues(whole, degrees, YOUNG, POISSON, DENSITY)
    of_tetrahedra = quadratic_tetrahedra([ring], 0.012, 8).values
    for values, within in ((of_polynomials, 3e-3), (of_tetrahedra, 8e-3)):
        assert np.allclose(np.sqrt(values[6:14]) / (2.0 * np.pi), found, rtol=within)
        assert (np.sqrt(values[6:14]) / (2.0 * np.pi) > found).all()


def test_notches_are_corners_that_point_inwards():
    neck = profiles.dumbbell()
    assert len(neck.notches) == 2 and np.allclose(neck.points[neck.notches][:, 0], 0.0105)
    for convex in (profiles.hemisphere(), profiles.ring(), profiles.disc()):
        assert len(convex.notches) == 0


@pytest.mark.parametrize("name", ["wine-glass", "cymbal"])
def test_profiles_are_those_that_surfaces_are_turned_from(name):
    surface = builtin_surface(name)
    profile = profile_of(surface)
    assert profile.is_ring == (name == "cymbal")
    again = profile.surface(96)
    angle = 2.0 * np.pi / 96
    assert again.volume == pytest.approx(surface.volume * angle / np.sin(angle), rel=1e-9)
    assert profile.distances(surface.vertices).max() < 1e-9


@pytest.mark.parametrize("name", SOLIDS)
def test_turned_surfaces_enclose_the_solid(name):
    solid = SOLIDS[name]
    surface = solid.surface(TURNED)
    assert surface.is_watertight and surface.is_winding_consistent
    if (profile := solid.profile) is not None:
        r, z = profile.points.T
        after, above = np.roll(r, -1), np.roll(z, -1)
        volume = np.pi / 3.0 * np.sum((above - z) * (r**2 + r * after + after**2))
        assert surface.volume == pytest.approx(abs(volume), rel=1e-9)


@needs_gmsh
def test_overlapping_parts_are_united():
    points, elements = mesh(SOLIDS["fork"].parts(), 0.02)
    a, b, c, d = (points[elements[:, corner]] for corner in range(4))
    volume = np.abs(np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a)).sum() / 6.0
    tines, yoke, stem = 2 * 0.03 * 0.03 * 0.17, 0.08 * 0.03 * 0.03, 0.02 * 0.02 * 0.06
    both = 2 * 0.03 * 0.03 * 0.01 + 0.02 * 0.02 * 0.01
    assert volume == pytest.approx(tines + yoke + stem - both, rel=1e-9)


@needs_gmsh
def test_tetrahedra_are_smaller_at_joints():
    parts = SOLIDS["fork"].parts()
    coarse, fine = (len(mesh(parts, 0.02, finer)[1]) for finer in (1.0, 4.0))
    assert fine > 2 * coarse


def test_plans_name_the_solids_that_there_are():
    assert tuple(SOLIDS) == NAMES


def test_every_solid_has_a_reference_that_is_good_for_its_aims():
    found = read_references()
    assert set(found) >= set(SOLIDS)
    for reference in (found[name] for name in SOLIDS):
        assert len(reference.hertz) == COUNT and reference.doubt < DOUBT
        assert (np.diff(reference.hertz) >= 0.0).all()


@needs_gmsh
def test_a_coarse_reference_is_above_the_one_in_the_file():
    """Within its doubt; the file's is a bound from above, too."""
    coarse, kept = compute_reference("ring", SOLIDS["ring"], 4.0), read_references()["ring"]
    ratio = coarse.hertz / kept.hertz
    assert ratio.min() > 1.0 - 1e-6 and ratio.max() < 1.02
    assert coarse.method == kept.method and coarse.doubt > kept.doubt


def test_polynomials_are_those_of_the_file():
    found = compute_reference("box", SOLIDS["box"])
    assert found.method == POLYNOMIALS
    assert np.allclose(found.hertz, read_references()["box"].hertz, rtol=1e-6)


def test_references_are_read_as_they_were_written(tmp_path):
    path = tmp_path / "references.yaml"
    assert read_references(path) == {}
    reference = StoredReference(np.array([1.5, 2.5]), 1e-4, POLYNOMIALS, "degrees 4, 4, 4")
    write_references({"ring": reference}, path)
    assert read_references(path)["ring"].as_entry() == reference.as_entry()


def test_without_the_package_references_of_files_get_a_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "pytetwild", None)
    solid = WalledSolid("Bar", "file", lambda: builtin_surface("bar"), 0.0)
    with pytest.raises(UserError, match=r"need fTetWild .*: pip install pytetwild\[all\]"):
        compute_reference("mine", solid)


def test_what_no_method_suits_gets_a_sentence():
    solid = WalledSolid("Bar", "thick", lambda: builtin_surface("bar"), 0.0)
    with pytest.raises(UserError, match="no method finds references of 'other'; known are"):
        compute_reference("other", solid)


def test_references_are_not_computed_for_a_folder(refuses, monkeypatch, tmp_path):
    monkeypatch.setattr(references_command, "compute_reference", None)
    out = f"{tmp_path}/references.yaml/"
    said = refuses(main, "study", "thin-wall-references", "--solids", "ring", "--out", out)
    assert f"{out}: names a folder" in said


def test_unknown_solids_get_one_sentence(refuses):
    said = refuses(main, "study", "thin-wall-references", "--solids", "ring,cube")
    assert "'cube' is unknown, expected some of wine-glass" in said
    said = refuses(main, "study", "thin-walls", "--mesh", "teapot.obj")
    assert "'teapot.obj' is no NAME=FILE" in said
