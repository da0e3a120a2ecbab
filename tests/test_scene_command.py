"""`carillon scene` from a file to files."""

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest
import soundfile

from sound.scenes.performance import COLUMNS
from sound.scenes.playing.tune import BEAT_SECONDS, tune_of
from studio.__main__ import main
from tests.scenes import require_engine, struck

SCENE = """\
title: A bar and a marble
seconds: 0.6
objects:
  - {name: bar, mesh: builtin:bar, material: steel, resolution: 12, count: 6, position: [0, 0, .05]}
  - {name: marble, radius: 0.01, material: glass, count: 0, position: [0.02, 0, 0.2]}
"""


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    require_engine()
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.yaml").write_text(SCENE)
    return tmp_path


def test_everything_is_written_and_told(folder, capsys):
    files = ["--video", "s.webm", "--page", "s.html", "--gltf", "s.glb", "--impacts", "s.csv"]
    assert main(["scene", "scene.yaml", "--out", "s.wav", *files, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    samples, rate = soundfile.read("s.wav")
    assert samples.shape == (round(0.6 * rate), 2) and np.abs(samples).max() <= 1.0
    assert told["objects"] == 2 and told["modes"] == 6
    assert told["accuracy"]["bar"]["discretisation"] == "finite-cell"
    assert 0.0 < told["accuracy"]["bar"]["solid_frequency_error_rms"] and not told["moved_metres"]
    assert all((folder / f"s.{ending}").stat().st_size for ending in ("webm", "html", "glb"))
    with open("s.csv", newline="") as file:
        lines = list(csv.DictReader(file))
    assert tuple(lines[0]) == COLUMNS and len(lines) == told["impacts"]
    assert {"ground", "marble"} <= {line["second"] for line in lines} | {
        line["first"] for line in lines
    }
    assert float(lines[0]["time_seconds"]) == pytest.approx(told["first_impact_seconds"])


def test_what_is_sought_is_told_and_what_is_known_is_not(folder, monkeypatch, capsys):
    monkeypatch.setenv("CARILLON_CACHE", str(folder / "cache"))
    assert main(["scene", "scene.yaml", "--out", "s.wav"]) == 0
    assert re.fullmatch(r"finding 6 modes of 'bar': [\d,]+ unknowns\n", capsys.readouterr().err)
    assert main(["scene", "scene.yaml", "--out", "s.wav"]) == 0
    assert not capsys.readouterr().err


def test_the_same_scene_makes_the_same_files(folder, monkeypatch):
    for number, threads in enumerate(("1", "2")):
        monkeypatch.setenv("OMP_NUM_THREADS", threads)
        names = ["--out", f"{number}.wav", "--page", f"{number}.html", "--impacts", f"{number}.csv"]
        assert main(["scene", "scene.yaml", *names]) == 0
    for ending in ("wav", "html", "csv"):
        assert Path(f"0.{ending}").read_bytes() == Path(f"1.{ending}").read_bytes()


def test_a_tune_strikes_its_bars_in_turn_in_time_and_in_tune():
    require_engine()
    bodies, impacts, _ = struck(tune_of("C7 E7 G7"))
    on_bars = [
        contact.impact
        for contact in impacts
        if min(contact.impact.pair) == 0 and max(contact.impact.pair)
    ]
    assert [max(impact.pair) for impact in on_bars] == [1, 2, 3]
    beats = np.diff([impact.seconds for impact in on_bars])
    assert beats == pytest.approx(BEAT_SECONDS, rel=0.03)
    hertz = [body.solid.frequencies[0] for body in bodies[1:]]
    assert np.log2(np.array(hertz) / 440.0) * 12 == pytest.approx([27, 31, 34], abs=0.01)


def test_the_summary_tells_what_moves_at_the_end_and_what_nobody_hears(folder, capsys):
    marble = "radius: 0.01, material: glass, count: 6, resolution: 12, stands_on: ground"
    end = f"  - {{name: rolling, {marble}, position: [0, 0.3, 0], velocity: [0.5, 0, 0]}}\n"
    described = f"seconds: 0.5\nobjects:\n  - {{name: lying, {marble}}}\n{end}"
    (folder / "scene.yaml").write_text(described)
    assert main(["scene", "scene.yaml", "--out", "s.wav"]) == 0
    told = capsys.readouterr().out
    assert re.search(r"^lying, rolling: 6 modes from 1\d\d,.* Hz, which nobody hears, ", told, re.M)
    assert re.search(r"^rolling \(0\.\d+ m/s\) still moves at the end$", told, re.M)
    assert main(["scene", "scene.yaml", "--out", "s.wav", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["above_hearing"] == ["lying", "rolling"]
    assert 0.1 < told["moving_at_end_metres_per_second"].pop("rolling") < 1.1
    assert not told["moving_at_end_metres_per_second"]
    (folder / "scene.yaml").write_text(described.replace(end, ""))
    assert main(["scene", "scene.yaml", "--out", "s.wav"]) == 0
    assert capsys.readouterr().out.endswith("\nall objects rest at the end\n")


def test_the_summary_tells_the_distance_and_what_was_moved(folder, capsys):
    described = SCENE.replace("0.02, 0, 0.2]", "0.3, 0, 0.00995]").replace("0.6", "0.2")
    (folder / "scene.yaml").write_text(described)
    assert main(["scene", "scene.yaml", "--out", "s.wav"]) == 0
    told = capsys.readouterr()
    assert "\nbar: 6 modes from " in told.out and " cents rms, worst +" in told.out
    assert "object 'marble' from the ground by 0.05 mm to [0.3, 0, 0.01]" in told.err
