"""Convex parts fill the solid, leave its hollows free, and are cut once."""

from importlib import metadata
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from carillon.errors import UserError
from carillon.fem.geometry import builtin_surface
from sound.scenes import convex, cuttable
from sound.scenes.convex import MOST_VERTICES, convex_parts
from sound.strikes import struck_surface
from tests.edited_files import edited

POINTS = 20_000
"""Random ones, by which volumes are measured: to 1 % of a solid that fills a fifth of its box."""
HOLLOWS = {"frying-pan": (0.0, 0.0, 0.045), "cup": (0.0, 0.0, 0.12)}
"""Points [m] well inside of what can be filled."""


def corner() -> trimesh.Trimesh:
    """Two thick walls at a right angle: the simplest solid that is not convex."""
    outline = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.04), (0.04, 0.04), (0.04, 0.1), (0.0, 0.1)]
    low = np.array([(x, y, 0.0) for x, y in outline])
    vertices = np.concatenate([low, low + (0.0, 0.0, 0.03)])
    lid = np.array([(0, 1, 2), (0, 2, 3), (0, 3, 4), (0, 4, 5)])
    sides = [((n, m, m + 6), (n, m + 6, n + 6)) for n, m in zip(range(6), [1, 2, 3, 4, 5, 0])]
    faces = np.concatenate([lid[:, ::-1], lid + 6, np.reshape(sides, (-1, 3))])
    return trimesh.Trimesh(vertices, faces)


def parts_of(surface: trimesh.Trimesh) -> list[np.ndarray]:
    return convex_parts(np.asarray(surface.vertices), np.asarray(surface.faces))


def within(parts: list[np.ndarray], points: np.ndarray) -> np.ndarray:
    """Whether points (p, 3) are in one of the hulls."""
    planes = [ConvexHull(part).equations for part in parts]
    return np.any([(points @ p[:, :3].T + p[:, 3] <= 0.0).all(axis=1) for p in planes], axis=0)


def volume(parts: list[np.ndarray], surface: trimesh.Trimesh) -> float:
    """Of all hulls together [m^3]."""
    low, high = surface.bounds
    points = np.random.default_rng(0).uniform(low, high, (POINTS, 3))
    return float(within(parts, points).mean() * np.prod(high - low))


@pytest.fixture
def cache(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv("CARILLON_CACHE", str(tmp_path))
    return tmp_path / "convex"


@pytest.mark.parametrize("name", ["frying-pan", pytest.param("cup", marks=pytest.mark.nightly)])
def test_parts_fill_the_solid_and_leave_its_hollow_free(name):
    surface = builtin_surface(name)
    parts = parts_of(surface)
    pieces = surface.split()
    solid = sum(piece.volume for piece in pieces)  # they overlap by less than 1 %
    assert volume(parts, surface) == pytest.approx(solid, rel=0.1)
    assert not within(parts, np.array([HOLLOWS[name]])).any()
    for part in parts:
        assert 4 <= len(part) <= MOST_VERTICES
        assert len(ConvexHull(part).vertices) == len(part)


def test_a_convex_solid_is_one_hull_and_needs_no_coacd(monkeypatch):
    def missing(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", missing)
    (box,) = parts_of(builtin_surface("box"))
    corners = builtin_surface("box").vertices
    np.testing.assert_array_equal(np.unique(box, axis=0), np.unique(corners, axis=0))
    with pytest.raises(UserError, match=r"is not installed; pip install -r .*-scenes\.txt$"):
        parts_of(corner())


def test_two_walls_are_two_parts_quietly(cache, capfd):
    surface = corner()
    parts = parts_of(surface)
    assert capfd.readouterr() == ("", "")
    assert len(parts) == 2
    assert sum(ConvexHull(part).volume for part in parts) == pytest.approx(surface.volume, rel=1e-3)


def test_what_was_cut_is_cached_and_cut_again_once_damaged(cache, monkeypatch):
    first = parts_of(corner())
    (entry,) = cache.iterdir()
    whole = entry.read_bytes()
    with monkeypatch.context() as patch:
        patch.setattr(convex, "_searched", None)  # calls of it would fail
        for part, again in zip(first, parts_of(corner())):
            np.testing.assert_array_equal(part, again)
    entry.write_bytes(whole[: len(whole) // 2])
    for part, again in zip(first, parts_of(corner())):
        np.testing.assert_array_equal(part, again)
    assert [path.name for path in cache.iterdir()] == [entry.name]
    assert convex._read(entry)


def test_parts_depend_on_what_was_asked_alone(tmp_path, monkeypatch):
    surface = builtin_surface("bar")
    runs = []
    for name in ("one", "other"):
        monkeypatch.setenv("CARILLON_CACHE", str(tmp_path / name))
        runs.append(parts_of(surface))
    assert len(runs[0]) == len(runs[1]) > 1
    for part, again in zip(*runs):
        np.testing.assert_array_equal(part, again)
    convex_parts(surface.vertices, surface.faces, concavity=0.2)
    assert len(list((tmp_path / "other" / "convex").iterdir())) == 2


def test_a_hole_in_the_surface_is_no_hole_in_the_solid():
    surface = corner()
    solid = surface.volume
    surface.update_faces(np.arange(len(surface.faces)) != 0)
    assert not surface.is_watertight
    parts = parts_of(surface)
    assert volume(parts, surface) == pytest.approx(solid, rel=0.1)
    assert not within(parts, np.array([(0.08, 0.08, 0.015)])).any()


def test_a_cavity_stays_empty():
    shell = trimesh.creation.box((0.1, 0.1, 0.1))
    cavity = trimesh.creation.box((0.06, 0.06, 0.06))
    cavity.invert()
    parts = parts_of(shell + cavity)
    assert not within(parts, np.zeros((1, 3))).any()
    assert volume(parts, shell) == pytest.approx(0.1**3 - 0.06**3, rel=0.1)


def test_a_fine_surface_is_made_coarser_without_crossing_itself():
    fine = struck_surface("builtin:frying-pan").split()[0]  # its planes are cut finely, too
    coarse, preprocessing = cuttable.coarser(fine)
    assert preprocessing == "off" and coarse.is_volume
    assert len(coarse.faces) <= min(convex.MOST_FACES) < len(fine.faces)
    assert coarse.volume == pytest.approx(fine.volume, rel=1e-3)


def test_surfaces_that_cross_themselves_are_told():
    box = trimesh.creation.box((0.1, 0.1, 0.1))
    beside = box.copy().apply_translation((0.11, 0.012, 0.023))
    through = box.copy().apply_translation((0.06, 0.012, 0.023))
    assert not cuttable.crosses_itself(box + beside)
    assert cuttable.crosses_itself(box + through)


def test_of_many_vertices_those_are_kept_that_matter():
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=0.1)
    (part,) = parts_of(sphere)
    assert len(part) == MOST_VERTICES
    assert ConvexHull(part).volume > 0.9 * sphere.volume


def test_no_finer_parts_are_asked_for_than_can_be_had():
    with pytest.raises(UserError, match=r"^concavity 0\.001: expected 0\.01 to 1$"):
        convex_parts(corner().vertices, corner().faces, concavity=0.001)


@pytest.mark.parametrize("faces", [[(0, 1, 2)], []])
def test_what_encloses_nothing_is_refused(faces):
    vertices = np.array([(0.0, 0.0, 0.0), (0.1, 0.0, 0.0), (0.0, 0.1, 0.0)])
    with pytest.raises(UserError, match="^the surface encloses nothing that 160 cells"):
        convex_parts(vertices, np.array(faces, dtype=int).reshape(-1, 3))


def test_a_failure_of_coacd_is_one_sentence(cache, monkeypatch):
    def fails(command: list[str], environment: dict[str, str]) -> CompletedProcess[str]:
        return CompletedProcess(command, -6, "", "terminate called\n  what():  Wrong clip!\n")

    monkeypatch.setattr(convex, "run_child", fails)
    with pytest.raises(UserError) as refusal:
        parts_of(corner())
    assert str(refusal.value).startswith(
        "the surface could not be cut into convex parts (CoACD: what(): Wrong clip!); repair it"
    )
    assert not cache.exists()


@pytest.mark.parametrize(
    ("name", "place"),
    [("vertices", (0, 0)), pytest.param("counts", 0, marks=pytest.mark.nightly)],
)
def test_hulls_that_nobody_cut_are_not_taken_from_the_cache(cache, name, place):
    surface = builtin_surface("slit-ring")
    first = parts_of(surface)
    (entry,) = cache.iterdir()
    with edited(entry) as file:
        file[name][place] = np.nan if name == "vertices" else 2
    for one, other in zip(parts_of(surface), first, strict=True):
        np.testing.assert_array_equal(one, other)
