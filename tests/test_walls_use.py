"""Walls in commands, files, projects, scenes and runs; lengths with a unit."""

import argparse
import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from trimesh.proximity import closest_point

import carillon as ca
from carillon.errors import UserError
from carillon.fem.geometry.walls import WallSize
from carillon.parameters import checked
from carillon.parameters.quantities import Length
from solver.__main__ import main
from solver.analysis.problem import ProblemOptions, build_problem
from solver.files.modes_file import read_modes
from sound.design.preparation import prepared_solid
from sound.project.project import project_of
from sound.scenes.bodies import bodies_of, with_modes
from studio.processes.composition import PlacingProcess
from studio.processes.solid import SolidProcess
from tests.scenes import scene
from tests.theories import plate_frequencies
from workflow.commands import validate
from workflow.composition import surface_of
from workflow.configuration.whole import completed

SIDES = 0.2, 0.15
WALLED = {"discretisation": "finite-cell", "wall": "2 mm", "resolution": 10}


@pytest.fixture
def sheet(tmp_path):
    """The file of a flat rectangle of two triangles."""
    corners = [[0, 0, 0], [SIDES[0], 0, 0], [*SIDES, 0], [0, SIDES[1], 0]]
    file = tmp_path / "sheet.obj"
    trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False).export(file)
    return str(file)


@pytest.fixture
def plate(tmp_path):
    """The file of the same as a box, 2 mm thick."""
    file = tmp_path / "plate.obj"
    box = trimesh.creation.box(bounds=[[0, 0, -0.001], [*SIDES, 0.001]])
    box.export(file)
    return str(file)


@pytest.mark.parametrize(
    ("given", "metres"),
    [
        ("0.8 mm", 8e-4),
        ("0.8mm", 8e-4),
        ("12 cm", 0.12),
        ("5e-4 m", 5e-4),
        ("80 um", 8e-5),
        (2, 2.0),
    ],
)
def test_lengths_are_numbers_of_metres_or_have_a_unit(given, metres):
    assert checked("wall", given, Length) == pytest.approx(metres, rel=1e-12)


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ("0.8", "found '0.8', expected a number of metres, or a length such as '0.8 mm'"),
        ("1 inch", "found '1 inch'"),
        ("-1 mm", "expected above 0"),
        (0.0, "expected above 0"),
        (None, "expected a number"),
    ],
)
def test_other_lengths_are_refused(given, says):
    with pytest.raises(UserError, match=says):
        checked("wall", given, Length)


def test_modes_of_a_sheet_with_a_wall_are_those_of_the_plate(sheet, plate, tmp_path, capsys):
    out, other = tmp_path / "sheet.h5", tmp_path / "plate.h5"
    how = ["--resolution", 10, "--modes", 10, "--discretisation", "finite-cell", "--json"]
    for words in (
        [sheet, *how, "--wall", "2 mm", "--out", out],
        [plate, *how, "--out", other],
        [sheet, *how, "--wall", "2 mm", "--wall-side", "outside", "--out", tmp_path / "out.h5"],
    ):
        assert main(["modes", *map(str, words)]) == 0
    walled, boxed, outside = map(json.loads, capsys.readouterr().out.splitlines())
    assert walled["frequencies_hz"][6:] == pytest.approx(boxed["frequencies_hz"][6:], rel=1e-6)
    assert outside["frequencies_hz"][6:] == pytest.approx(boxed["frequencies_hz"][6:], rel=1e-6)
    assert walled["extents_m"] == pytest.approx([*SIDES, 0.002])
    assert (walled["wall"], walled["wall_side"], "wall" in boxed) == (0.002, "about", False)
    file = read_modes(out)
    assert file.wall == WallSize(0.002) and read_modes(other).wall is None
    assert read_modes(tmp_path / "out.h5").wall == WallSize(0.002, "outside")
    shown = tmp_path / "sheet.vtu"
    assert main(["vtu", str(out), "--surface", sheet, "--out", str(shown)]) == 0
    assert main(["compare", str(out), str(other)]) == 0


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--wall", "2 mm"], "found a wall of voxels, expected finite cells"),
        (["--wall", "2 mm", "--discretisation", "voxel"], "add --discretisation finite-cell"),
        (["--wall", "9 um", *"--discretisation finite-cell".split()], "expected at least 0.01 of"),
        (["--wall", "3", *"--discretisation finite-cell".split()], "longest side is 20 cm"),
        (["--discretisation", "finite-cell"], "is flat, .* such as a wall with finite cells"),
    ],
)
def test_walls_that_cannot_be_are_refused_in_one_sentence(sheet, words, says, tmp_path, capsys):
    given = ["modes", sheet, "--resolution", "10", "--out", str(tmp_path / "x.h5"), *words]
    assert main(given) != 0
    told = capsys.readouterr().err
    assert len(told.splitlines()) == 1
    with pytest.raises(AssertionError, match=says):
        raise AssertionError(told)


def test_a_solid_of_regions_and_files_of_regions_take_a_wall_as_they_should(sheet, tmp_path):
    described = tmp_path / "regions.yaml"
    described.write_text(
        "regions: [{name: left, material: steel}, {name: right, material: tin, where: x > 0.1}]\n"
        "supports: [{where: x <= 0}]\n"
    )
    problem = build_problem(ProblemOptions(sheet, regions=str(described), **WALLED))
    mass = 0.5 * np.prod(SIDES) * 0.002 * (problem.regions.density.sum())
    assert problem.model.mass == pytest.approx(mass, rel=1e-6)
    assert problem.model.rigid_modes == 0
    with pytest.raises(UserError, match="expected one mesh that a wall follows"):
        build_problem(ProblemOptions(str(described), **WALLED))


def test_the_interface_of_python(sheet, plate):
    steel = ca.Material.named("steel")
    how = {"resolution": 10, "modes": 9, "discretisation": "finite-cell"}
    first = ca.solve(sheet, steel, wall="2 mm", **how)
    wanted = ca.solve(plate, steel, **how).frequencies[6:]
    mesh = ca.load_mesh(sheet, wall=0.002)
    assert np.allclose(mesh.skin.bounds, ca.load_mesh(plate).surface.bounds)
    for found in (first, ca.solve(mesh, steel, **how)):
        assert found.frequencies[6:] == pytest.approx(wanted, rel=1e-6)
        assert found.evidence["wall"] == 0.002
    with pytest.raises(UserError, match="voxels hold no wall; take discretisation='finite-cell'"):
        ca.solve(mesh, steel, resolution=10)
    with pytest.raises(UserError, match="wall goes with the file of a mesh"):
        ca.solve(mesh, steel, wall=0.001, **how)


def targets(*positions):
    return [{"name": f"{n}", "at": at, "clip": "no.wav"} for n, at in enumerate(positions)]


def test_a_project_strikes_the_skin_of_its_wall(sheet, tmp_path):
    project = project_of(
        {"mesh": "sheet.obj", **WALLED, "targets": targets([0.2, 0.0, 0.0])}, tmp_path
    )
    assert project.as_dict()["wall"] == 0.002
    surface = project.surface()
    (strike,) = project.strikes(surface)
    assert abs(strike.position[2]) == pytest.approx(0.001)
    first = {**WALLED, "targets": [{"name": "0", "vertex": 2, "clip": "no.wav"}]}
    (strike,) = project_of({"mesh": "sheet.obj", **first}, tmp_path).strikes(surface)
    assert strike.position == pytest.approx([*SIDES, 0.001])
    solid = prepared_solid(project.solid, project.material, surface)
    assert solid.cells is not None
    assert solid.cells.volume == pytest.approx(np.prod(SIDES) * 0.002, rel=1e-9)
    with pytest.raises(UserError, match="found a wall of voxels"):
        project_of({"mesh": "sheet.obj", "wall": 0.002, "targets": targets([0, 0, 0])}, tmp_path)


def test_the_studio_shows_the_skin_of_a_wall(sheet):
    news = SolidProcess().read(sheet, 1.0, WallSize(0.002), None, 1)
    assert news.vertices > 8 and max(news.hints.extents) == pytest.approx(0.2)
    rows = {"regions": [{"name": "top", "material": "tin", "where": "z > 0"}], "supports": []}
    _, faults = PlacingProcess().place(sheet, 1.0, rows, WallSize(0.002), None, Path(), 1)
    assert not faults


def test_a_sheet_in_a_scene_sounds_as_a_thin_plate(tmp_path):
    corners = [[0, 0, 0], [200, 0, 0], [200, 200, 0], [0, 200, 0]]
    file = tmp_path / "square.obj"
    trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False).export(file)
    given = {"name": "it", "mesh": str(file), "unit": 0.001, "material": "steel", "count": 3}
    described = scene({**given, "wall": "0.8 mm", "resolution": 20, "collision": "hull"})
    (found,) = with_modes(bodies_of(described.objects))
    material = found.entry.made_of
    wanted = plate_frequencies(0.2, 0.0008, material.young, material.density)[0]
    assert found.solid.frequencies[0] == pytest.approx(wanted, rel=0.02)
    assert found.mass == pytest.approx(material.density * 0.2**2 * 0.0008, rel=1e-6)
    with pytest.raises(UserError, match="a wall is of finite cells"):
        scene({**given, "wall": "0.8 mm", "discretisation": "voxel"})
    with pytest.raises(UserError, match="wall goes with mesh, found a radius"):
        scene({"name": "it", "radius": 0.01, "material": "steel", "wall": "0.8 mm"})


def test_a_validation_takes_a_wall(sheet, tmp_path):
    parser = argparse.ArgumentParser()
    validate.add_arguments(parser)
    words = f"{sheet} --resolution 10 --discretisation finite-cell --wall 2mm --out {tmp_path}"
    config = completed(validate.configuration(parser.parse_args(words.split())))
    (name,) = config["models"]
    assert (config["models"][name]["wall"], config["models"][name]["wall_side"]) == (0.002, "about")
    skin = surface_of(config, name)
    assert np.allclose(skin.bounds, [[0, 0, -0.001], [*SIDES, 0.001]])
    assert closest_point(skin, [[0.1, 0.1, 0.0]])[1] == pytest.approx(0.001)
