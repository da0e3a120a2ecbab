"""What is said of a mesh that is opened, and what turns and scales it: unit, up axis, shells."""

import json
import re

import numpy as np
import pytest
import trimesh
import yaml

import carillon as ca
from carillon.command_line.logs import warn_once
from carillon.composition.entries import RegionEntry, SolidFrame
from carillon.errors import UserError
from carillon.fem.geometry import load_surface
from carillon.fem.geometry.labels import read_labels
from carillon.fem.geometry.parts import named_surfaces
from carillon.fem.geometry.turning import turned_back, turned_points, turned_upright
from carillon.parameters import checked
from carillon.parameters.quantities import LENGTHS, UP_AXES, MetresPerUnit
from solver.__main__ import main as solve
from solver.analysis.problem import ProblemOptions, build_problem
from solver.files.modes_file import read_modes
from sound.__main__ import main as sound
from sound.project.project import load_project, project_of
from sound.scenes.bodies import bodies_of
from tests.mesh_files import block
from tests.scenes import scene
from workflow.composition import surface_of
from workflow.configuration.whole import completed

BOX = block((-0.2, 0.0, -0.05), (0.2, 0.02, 0.05))
"""A board that lies flat where y points up."""


@pytest.fixture
def board(tmp_path):
    """Path of an OBJ file of the board, which has a name of its own: hints are told once."""
    path = tmp_path / f"{tmp_path.name}.obj"
    BOX.export(path)
    return str(path)


@pytest.fixture
def bowl(tmp_path):
    """The same of a half of a sphere, an open surface."""
    path = tmp_path / f"{tmp_path.name}.ply"
    ball = trimesh.creation.icosphere(3, 0.1)
    low = ball.triangles_center[:, 2] < 0.0
    trimesh.Trimesh(ball.vertices, ball.faces[low], process=False).export(path)
    return str(path)


def hints(caplog) -> list[str]:
    found = [record.message for record in caplog.records]
    caplog.clear()
    return found


# Units --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("word", LENGTHS)
def test_a_unit_is_a_word_wherever_it_is_a_number(board, tmp_path, word):
    metres = LENGTHS[word]
    assert checked("unit", word, MetresPerUnit) == metres
    longest = pytest.approx(0.4 * metres)
    assert ca.load_mesh(board, unit=word).extents.max() == longest
    assert max(build_problem(ProblemOptions(board, 20, unit=word)).extents) == longest
    target = {"name": "t", "vertex": 0, "clip": "c.wav"}
    project = project_of({"mesh": board, "unit": word, "targets": [target]}, tmp_path)
    assert project.unit == metres and project.surface().extents.max() == longest
    model = {"mesh": board, "resolution": 8, "unit": word}
    config = completed({"title": "t", "results_dir": "r", "models": {"a": model}})
    assert config["models"]["a"]["unit"] == metres
    region = RegionEntry(name="a", mesh=board, unit=word)
    assert region.unit == metres


def test_a_unit_on_the_command_line_is_a_word(board, tmp_path, capsys):
    out = str(tmp_path / "m.h5")
    words = ["modes", board, "--resolution", "20", "--modes", "8", "--no-estimate", "--out", out]
    assert solve([*words, "--unit", "cm", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["extents_m"] == pytest.approx([4e-3, 2e-4, 1e-3])
    assert solve([*words, "--unit", "furlong"]) == 2
    said = capsys.readouterr().err
    assert "found 'furlong', expected one of m, cm, mm, um, µm, in, or a number of metres" in said


@pytest.mark.parametrize(
    ("longest", "unit", "units"),
    [
        (202.0, 1.0, ["mm", "cm"]),
        (6.4, 1.0, ["cm", "in"]),
        (2.9, 1.0, []),
        (4e5, 1.0, ["mm"]),
        (2e-4, 0.001, ["m"]),
        (0.2, 0.001, []),
    ],
)
def test_units_that_make_a_usual_size_are_proposed(longest, unit, units):
    from carillon.fem.geometry.size import likely_units

    assert list(likely_units([longest, 1e-5, 1e-5], unit)) == units


# Up axis ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("up", UP_AXES)
def test_the_axis_that_points_up_becomes_z_without_rounding(up):
    axis = np.zeros((1, 3))
    axis[0, "xyz".index(up[-1])] = -1.0 if up.startswith("-") else 1.0
    assert turned_points(axis, up).tolist() == [[0.0, 0.0, 1.0]]
    assert (turned_back(turned_points(BOX.vertices, up), up) == BOX.vertices).all()
    turned = turned_upright(BOX, up)
    assert turned.volume == pytest.approx(BOX.volume)  # neither mirrored nor inside out


def test_a_solid_is_turned_in_all_programs(board, tmp_path, capsys):
    sides = [0.4, 0.1, 0.02]
    assert ca.load_mesh(board, up="y").extents.tolist() == pytest.approx(sides)
    out = str(tmp_path / "m.h5")
    words = ["modes", board, "--resolution", "20", "--modes", "10", "--no-estimate", "--out", out]
    assert solve([*words, "--up", "y", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["extents_m"] == pytest.approx(sides)
    assert read_modes(out).up == "y"
    nodes = read_modes(out).model.mesh.nodes
    assert np.ptp(nodes, axis=0) == pytest.approx(sides)
    model = {"mesh": board, "resolution": 8, "up": "y"}
    config = completed({"title": "t", "results_dir": "r", "models": {"a": model}})
    assert surface_of(config, "a").extents.tolist() == pytest.approx(sides)
    (only,) = named_surfaces(board, up="y")
    assert only[1].extents.tolist() == pytest.approx(sides)


def test_frequencies_do_not_depend_on_what_points_up(board, tmp_path):
    found = {}
    for up in (None, "y", "-x"):
        out = str(tmp_path / "m.h5")
        words = ["modes", board, "--resolution", "20", "--modes", "10", "--no-estimate"]
        assert solve([*words, *([f"--up={up}"] if up else []), "--out", out]) == 0
        found[up] = read_modes(out).frequencies[6:]
    assert found["y"] == pytest.approx(found[None], rel=1e-6)
    assert found["-x"] == pytest.approx(found[None], rel=1e-6)


def test_what_is_named_beside_a_turned_solid_is_turned_with_it(board, tmp_path):
    """Meshes and labels of regions are in the axes of the solid's own mesh; expressions are not."""
    frame = SolidFrame(board, load_surface(board, up="y"), "board", up="y")
    half = tmp_path / "half.obj"
    block((0.0, 0.0, -0.05), (0.2, 0.02, 0.0)).export(half)
    region = RegionEntry(name="half", mesh=str(half))
    inside, outside = [0.1, 0.025, 0.01], [0.1, -0.025, 0.01]
    assert region.domain(frame).contains(np.array([inside, outside])).tolist() == [True, False]
    labels = tmp_path / "labels.npy"
    np.save(labels, np.array([[[0, 1]]]))  # along z of the file, which is -y of the turned solid
    read = read_labels(labels, box=np.asarray(frame.surface.bounds), up="y")
    assert read.at(np.array([inside, outside])).tolist() == [0, 1]
    top = RegionEntry(name="top", where="z > 0.01")
    points = np.array([[0.0, 0.0, 0.015], [0.0, 0.0, 0.005]])
    assert top.domain(frame).contains(points).tolist() == [True, False]


def test_a_gltf_solid_that_was_turned_is_not_turned_again_in_a_scene(tmp_path):
    file, out = tmp_path / "board.glb", str(tmp_path / "m.h5")
    BOX.export(file)
    words = ["modes", str(file), "--resolution", "20", "--modes", "10", "--no-estimate"]
    for up in ([], ["--up", "y"]):
        assert solve([*words, *up, "--out", out]) == 0
        entry = {"name": "board", "modes": out, "material": "steel"}
        (body,) = bodies_of(scene(objects=[entry]).objects)
        assert np.ptp(body.shape.vertices, axis=0)[2] == pytest.approx(0.02)
        # The axis that the scene names is one of the mesh file, whatever was turned before.
        (body,) = bodies_of(scene(objects=[entry | {"up": "-x"}]).objects)
        assert np.ptp(body.shape.vertices, axis=0) == pytest.approx([0.1, 0.02, 0.4])


@pytest.mark.parametrize("ending, given", [("obj", {"up": "y"}), ("glb", {})])
def test_regions_of_a_scene_are_in_the_turned_axes(tmp_path, ending, given):
    file = tmp_path / f"board.{ending}"
    BOX.export(file)
    regions = [
        {"name": "low", "material": "iron", "where": "z <= 0.01"},
        {"name": "top", "material": "beech", "where": "z > 0.01"},
    ]
    entry = {"name": "board", "mesh": str(file), "regions": regions, "count": 0, **given}
    (body,) = bodies_of(scene(objects=[entry]).objects)
    assert np.ptp(body.shape.vertices, axis=0) == pytest.approx([0.4, 0.1, 0.02])
    assert 0.0 < body.centre[2] < 0.01 and body.turn is None


# What is told -------------------------------------------------------------------------------------


def test_an_open_mesh_is_said_to_be_filled_and_a_shell_proposed(bowl, caplog):
    build_problem(ProblemOptions(bowl, 12))
    (said,) = hints(caplog)
    assert "surface is open; what it surrounds is filled" in said and "--wall 2mm" in said
    build_problem(ProblemOptions(bowl, 12, wall="2mm", discretisation="finite-cell"))
    assert not hints(caplog)


def test_a_scene_tells_all_doubts_by_the_keys_that_mend_them(tmp_path, caplog):
    mesh = tmp_path / f"{tmp_path.name}.ply"
    large = BOX.copy().apply_scale(1000.0)
    trimesh.Trimesh(large.vertices, large.faces[1:], process=False).export(mesh)
    entry = {"name": "board", "mesh": str(mesh), "material": "steel", "count": 0}
    for regions in ({}, {"regions": [{"name": "all", "material": "steel"}]}):
        warn_once.cache_clear()
        bodies_of(scene(objects=[entry | regions]).objects)
        unit, up, filled = hints(caplog)
        assert f"object 'board': {mesh}: it is 400 m" in unit
        assert "(unit: mm) it is 40 cm" in unit and "give wall: 5m," in filled
        assert "up: y stands it up" in up and "--" not in unit + filled + up
    warn_once.cache_clear()
    mended = {"wall": 0.002, "up": "z"}
    bodies_of(scene(objects=[entry | {"size": 0.4} | mended]).objects)
    bodies_of(scene(objects=[entry | {"unit": "mm"} | mended]).objects)
    assert not hints(caplog)


def test_nothing_is_said_of_a_built_in_object(caplog):
    build_problem(ProblemOptions("builtin:bell", 12, unit=0.01))
    entry = {"name": "bell", "mesh": "builtin:bell", "unit": 0.1, "material": "steel", "count": 0}
    bodies_of(scene(objects=[entry]).objects)
    assert not hints(caplog)


def test_nothing_is_said_of_bodies_that_touch_or_a_face_that_is_there_twice(tmp_path, caplog):
    touching = trimesh.util.concatenate([BOX, block((0.2, 0.0, -0.05), (0.4, 0.02, 0.05))])
    twice = trimesh.Trimesh(BOX.vertices, np.concatenate([BOX.faces, BOX.faces[:1]]), process=False)
    for number, surface in enumerate((BOX, touching, twice)):
        path = tmp_path / f"{tmp_path.name}-{number}.ply"
        surface.export(path)
        build_problem(ProblemOptions(str(path), 20))
        assert not [each for each in hints(caplog) if "open" in each]


def test_init_tells_size_and_all_doubts_and_writes_what_mends_them(tmp_path, caplog, capsys):
    mesh, file = tmp_path / f"{tmp_path.name}.stl", tmp_path / "p.yaml"
    large = BOX.copy().apply_scale(1000.0)
    trimesh.Trimesh(large.vertices, large.faces[1:], process=False).export(mesh)
    assert sound(["init", str(file), "--mesh", str(mesh)]) == 0
    assert "400 x 20 x 100 m" in capsys.readouterr().out
    unit, up, filled = hints(caplog)
    assert "--unit mm) it is 40 cm" in unit and "is filled" in filled and "--up y" in up
    file.unlink()
    mended = ["--unit", "mm", "--up", "y", "--wall", "2 mm"]
    assert sound(["init", str(file), "--mesh", str(mesh), *mended]) == 0
    said = capsys.readouterr().out
    assert re.search(r", 40.* x 10.* x 2.* cm;", said) and not hints(caplog)
    described = yaml.safe_load(file.read_text())
    assert (described["unit"], described["up"], described["wall"]) == ("mm", "y", 0.002)
    project = load_project(file)
    (strike,) = project.strikes(project.surface())
    assert strike.distance < 1e-4


def test_init_stands_up_what_its_format_says_is_on_its_side(tmp_path):
    mesh, file = tmp_path / "board.glb", tmp_path / "p.yaml"
    BOX.export(mesh)
    assert sound(["init", str(file), "--mesh", str(mesh)]) == 0
    assert load_project(file).surface().extents.tolist() == pytest.approx([0.4, 0.1, 0.02])


def test_an_axis_that_is_none_is_refused_in_one_sentence(board):
    with pytest.raises(UserError, match="up: found 'north', expected one of x, y, z, -x, -y, -z"):
        ca.load_mesh(board, up="north")
