"""Scenes of designs: what they are, how they are planned, and their page."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from carillon.composition.materials import MATERIALS, named_material
from sound.clips.wav import read_wav
from sound.scenes.performance import COLUMNS
from sound.scenes.scene import Scene
from sound.scenes.scene_file import load_scene
from studies.scenes import tables
from studies.scenes.config import ScenesSection
from studies.scenes.examples import (
    BARS,
    EXAMPLES,
    FOLDER,
    OUTPUTS,
    PAGE_SOURCES,
    SCENE,
    TOLD,
    command,
    material_of,
    scenes,
    spiral,
    triangle,
)
from studies.scenes.results import Scenes
from studies.scenes.study import SCENES
from studies.sounds import examples as sounds
from tests.pages import Page, assert_same_numbers, page_of
from tests.scenes import moved, require_engine
from tests.workflow_runs import TINY, snakemake
from workflow.commands.estimate import CONFIGURATIONS, load

CONFIG = load(CONFIGURATIONS / "laptop.yaml")
DESCRIBED = yaml.safe_load(EXAMPLES.read_text())
LARGEST = 0.25
"""What reaches farthest from its centre of mass [m]: the handle of a pan."""
IMPACTS = [
    ("0.100000", "ball", "ground", 0.5, 1.0, 2e-4),
    ("0.250000", "bar", "ball", 2.5, 3.0, 1e-4),
]


def read(name: str, folder: Path) -> Scene:
    """A scene, from its file among the results in a folder."""
    file = folder / FOLDER / name / SCENE
    file.parent.mkdir(parents=True)
    file.write_text(yaml.safe_dump(scenes(CONFIG)[name].content, sort_keys=False))
    return load_scene(file)


# What they are -----------------------------------------------------------------------------------


def test_the_configuration_names_the_scenes():
    assert ScenesSection().examples == tuple(DESCRIBED["scenes"])


def test_pages_are_made_anew_when_what_they_are_made_of_changes():
    found = {path.name for path in PAGE_SOURCES}
    assert {"playback.js", "scene.css", "template.html", "bank.js", "three.module.js"} <= found


def test_ten_designs_fall_from_heights_that_grow_and_overlap_nothing(tmp_path):
    scene = read("falling", tmp_path)
    places = np.array([each.position for each in scene.objects])
    assert len(places) == 10 and np.all(np.diff(places[:, 2]) > 0.0)
    assert (places[0, 2], places[-1, 2]) == (0.3, 2.0) and places[0, 2] > LARGEST
    between = np.linalg.norm(places[:, None] - places, axis=2)[np.triu_indices(10, 1)]
    assert between.min() > 2.0 * LARGEST
    landings = np.diff(np.sqrt(2.0 * places[:, 2] / 9.81))
    assert landings == pytest.approx(landings.mean(), abs=1e-3)
    assert all(each.velocity == (0.0, 0.0, 0.0) for each in scene.objects)


def test_what_falls_are_the_designs_of_the_list_over_and_over(tmp_path):
    scene = read("falling", tmp_path)
    names = CONFIG["sound"]["examples"]
    folders = [Path(each.design or "").resolve().parent for each in scene.objects]
    assert [folder.name for folder in folders] == [*names, *names[:3]]
    assert {folder.parent for folder in folders} == {tmp_path / sounds.FOLDER}
    assert scenes(CONFIG)["falling"].designs == tuple(names)


def test_a_short_list_of_designs_falls_more_than_once():
    config = {**CONFIG, "sound": {**CONFIG["sound"], "examples": ["pitcher"]}}
    content = scenes(config)["falling"].content
    assert content is not None
    assert [each["name"] for each in content["objects"][:3]] == [
        "pitcher",
        "pitcher 2",
        "pitcher 3",
    ]


def test_materials_of_designs_are_about_as_dense_as_these(tmp_path):
    assert set(DESCRIBED["materials"]) <= set(MATERIALS)
    for name in DESCRIBED["materials"]:
        assert material_of(named_material(name).density) == name
    assert material_of(1e6) == list(DESCRIBED["materials"])[-1]
    scene = read("falling", tmp_path)
    made_of = {each.name: each.material.name for each in scene.objects}
    assert made_of["frying-pan"] == "steel" and made_of["recorded-bell"] == "brass"
    assert made_of["pitcher"] == "ceramic" and made_of["chord"] == "plastic"


def test_a_design_is_bowled_at_pins_that_stand_on_the_ground_and_make_a_scale(tmp_path):
    scene = read("bowled", tmp_path)
    thrown, *pins = scene.objects
    assert Path(thrown.design or "").resolve() == tmp_path / sounds.FOLDER / "chord" / "design.h5"
    assert 1.5 <= thrown.velocity[0] <= 2.5 and thrown.spin[1] > 0.0
    assert thrown.position[0] < min(pin.position[0] for pin in pins) - LARGEST
    assert len(pins) == 10 and {pin.mesh for pin in pins} == {"builtin:bar"}
    pin = DESCRIBED["scenes"]["bowled"]["pin"]
    units = np.array([each.unit for each in pins])
    assert [each.position[2] for each in pins] == pytest.approx(pin["height"] * units, abs=1e-4)
    assert -12.0 * np.log2(units / pin["size"]) == pytest.approx(pin["semitones"])


@pytest.mark.nightly
def test_the_pins_stand(tmp_path):
    require_engine()
    scene = read("bowled", tmp_path)
    pins = tuple(replace(pin, count=0) for pin in scene.objects[1:])
    _, course = moved(replace(scene, objects=pins, seconds=0.5))
    assert np.abs(course.motion.positions - course.motion.positions[0]).max() < 1e-3


def test_the_first_design_is_bowled_where_there_is_no_chord():
    config = {**CONFIG, "sound": {**CONFIG["sound"], "examples": ["pitcher", "frying-pan"]}}
    assert scenes(config)["bowled"].designs == ("pitcher",)


def test_a_row_of_bars_needs_no_file_but_notes():
    row = scenes(CONFIG)["row"]
    assert row.files == [] and row.designs == ()
    assert command(row, "anywhere") == [BARS, "--notes", CONFIG["scenes"]["notes"]]
    assert len(CONFIG["scenes"]["notes"].split()) <= 16
    assert command(scenes(CONFIG)["falling"], "there") == [f"there/{SCENE}"]


def test_files_refer_to_nothing_within_themselves():
    for name in ("falling", "bowled"):
        assert "&" not in yaml.safe_dump(scenes(CONFIG)[name].content)


def test_points_are_as_far_apart_as_asked():
    for points in (spiral(10, 0.3), triangle(10, 0.3)):
        between = np.linalg.norm(points[:, None] - points, axis=2)[np.triu_indices(10, 1)]
        assert points.shape == (10, 2) and between.min() == pytest.approx(0.3)
    rows = np.unique(triangle(10, 1.0)[:, 0].round(9), return_counts=True)[1]
    assert list(rows) == [1, 2, 3, 4]
    assert spiral(1, 0.3).shape == (1, 2)


# How they are planned ----------------------------------------------------------------------------


def test_all_scenes_are_planned_with_the_designs_that_they_need(plan):
    jobs = plan(FOLDER)
    assert jobs["play_scene"] == 3 and jobs["write_scene"] == 2
    assert jobs["build_scenes"] == jobs["scenes"] == 1
    chosen = [sounds.examples(CONFIG)[name] for name in CONFIG["sound"]["examples"]]
    assert jobs["design_sound"] == sum(example.edits for example in chosen)
    assert not {"build_sound_page", "find_reach", "find_modes"} & set(jobs)


def test_the_tiny_run_plays_bars_alone(plan):
    jobs = plan(FOLDER, "--configfile", TINY)
    made = {"play_scene", "tabulate_scenes", "build_scenes"}
    assert set(jobs) == {*made, "save_config", "scenes", "total"}


# Their page --------------------------------------------------------------------------------------


@pytest.fixture
def results(tmp_path) -> Scenes:
    """Two scenes as if they had been played; of one Snakemake measured how long it took."""
    config = {**CONFIG, "scenes": {**CONFIG["scenes"], "examples": ["falling", "row"]}}
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(config))
    for name in ("falling", "row"):
        folder = tmp_path / FOLDER / name
        folder.mkdir(parents=True)
        for file in OUTPUTS.values():
            (folder / file).write_bytes(1000 * b"x")
        (folder / SCENE).touch()
        told = {"seconds": 8.0, "objects": 10, "modes": 60, "full_scale_decibels": 110.0}
        timings = {"bodies": 1.0, "motion": 2.0, "contacts": 0.25, "sound": 4.0, "voices": 0.5}
        (folder / TOLD).write_text(json.dumps({**told, "timings": timings}))
        write_impacts(folder / OUTPUTS["impacts"], IMPACTS if name == "falling" else [])
    (tmp_path / FOLDER / "tables").mkdir()
    benchmark = tmp_path / "benchmarks" / FOLDER / "falling.tsv"
    benchmark.parent.mkdir(parents=True)
    benchmark.write_text("s\th:m:s\tmax_rss\n12.5\t0:00:12\t300.0\n")
    return Scenes(tmp_path / FOLDER)


def write_impacts(path: Path, impacts: list[tuple]) -> None:
    """A list of impacts with the columns of the program's own."""
    keys = ("time_seconds", "first", "second", "impulse_newton_seconds")
    keys += ("approach_metres_per_second", "duration_seconds")
    with path.open("w", newline="") as file:
        table = csv.DictWriter(file, COLUMNS, restval=0.0)
        table.writeheader()
        table.writerows(dict(zip(keys, impact)) for impact in impacts)


def test_tables_tell_what_happened_and_how_long_it_took(results):
    first, second = tables.scenes(results).rows
    assert (first["impacts"], first["first"], first["hardest"]) == (2, 0.1, 2.5)
    assert (second["impacts"], second["first"], second["hardest"]) == (0, None, None)
    assert first["wall"] == 12.5 and second["wall"] == 7.75
    assert tables.files(results).rows[0]["out"] == 1000
    assert [row["first"] for row in tables.impacts(results).rows] == ["bar", "ball"]


def test_the_page_has_the_films_and_the_numbers_of_its_tables(results):
    read = page_of(SCENES, results, results.folder / "index.html")
    for name in SCENES.tables:
        hidden = ("title",) if name == "impacts" else ()
        assert_same_numbers(read, results.folder / "tables", name, hidden)
    loaded = [link for link in read.links if not link.startswith(("data:", "#"))]
    assert loaded == [
        f"{name}/{OUTPUTS[key]}" for name in ("falling", "row") for key in ("video", "out")
    ]
    files = [link for link in read.led if not link.startswith("#")]
    assert f"falling/{SCENE}" in files and f"row/{SCENE}" not in files
    assert all((results.folder / link).is_file() for link in [*loaded, *files])
    assert CONFIG["scenes"]["notes"] in read.source and "Fig. 16" in read.source
    assert len(read.ids) == len(set(read.ids)) and "<script" not in read.source


@pytest.mark.nightly
def test_the_tiny_scenes_are_played_and_shown(tmp_path):
    require_engine()
    done = snakemake(tmp_path, FOLDER, "--configfile", TINY, "--cores", 2)
    results = tmp_path / "results-tiny"
    log = results / "logs" / FOLDER / "row" / "play.log"
    assert done.returncode == 0, done.stderr + (log.read_text() if log.exists() else "")
    folder = results / FOLDER / "row"
    sound, rate = read_wav(folder / OUTPUTS["out"])
    told = json.loads((folder / TOLD).read_text())
    assert len(sound) / rate == pytest.approx(told["seconds"], abs=1e-3)
    with (folder / OUTPUTS["impacts"]).open(newline="") as file:
        struck = [line["first"] for line in csv.DictReader(file) if line["second"] == "ball"]
    assert struck == ["1 C6", "2 E6", "3 G6"]
    index = Page(results / FOLDER / "index.html")
    linked = [link for link in [*index.links, *index.led] if not link.startswith(("data:", "#"))]
    assert "row/scene.mp4" in linked
    assert all((results / FOLDER / link).stat().st_size > 0 for link in linked)
    table = Scenes(results / FOLDER).table("scenes")
    assert table.rows[0]["objects"] == 4 and table.rows[0]["wall"] > 0.0
