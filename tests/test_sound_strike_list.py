"""Many strikes in one sound, as a table says."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import soundfile

from sound.__main__ import main
from sound.project.design_file import write_design
from sound.rendering.listening import Listening
from sound.rendering.render import Hit, render
from sound.rendering.solid import SoundingSolid
from sound.rendering.strike_list import Point, read_strikes
from tests.small_design import SIDES, small_design

HEADER = "time_seconds,target,vertex,x,y,z,strength_newton_seconds"
LINES = ["0,corner,,,,,", "0.3,,,0,0,0,0.5", "0.15, side ,,,,, 2", "", "0.3,,0,,,,0.25"]


def written(folder: Path, *lines: str) -> Path:
    path = folder / "strikes.csv"
    path.write_text("\n".join(lines))
    return path


def test_lines_are_strikes_in_their_order(tmp_path):
    strikes = read_strikes(written(tmp_path, HEADER, *LINES))
    assert [strike.line for strike in strikes] == [2, 3, 4, 6]
    assert [strike.seconds for strike in strikes] == [0.0, 0.3, 0.15, 0.3]
    assert [strike.strength for strike in strikes] == [None, 0.5, 2.0, 0.25]
    points = [Point("corner"), Point(at=(0.0, 0.0, 0.0)), Point("side"), Point(vertex=0)]
    assert [strike.point for strike in strikes] == points


def test_columns_that_are_not_needed_may_be_left_out(tmp_path):
    text = "\ufefftarget,time_seconds\r\ncorner,1e-1\r\n"
    (tmp_path / "strikes.csv").write_bytes(text.encode())
    (strike,) = read_strikes(tmp_path / "strikes.csv")
    assert strike == (2, 0.1, Point("corner"), None)


def test_the_sound_is_that_of_all_strikes(tmp_path, capsys):
    design = small_design()
    write_design(tmp_path / "design.h5", design)
    path, out = written(tmp_path, HEADER, *LINES), tmp_path / "all.wav"
    words = ["render", tmp_path / "design.h5", "--strikes", path, "--strength", 1.5, "--json"]
    assert main([str(word) for word in [*words, "--raw", "--out", out]]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["strikes"] == 4 and "amplitudes" not in told
    corner, side = design.strikes
    solid = SoundingSolid.of_design(design)
    vertex = design.surface_vertices[0]
    inward = np.sign(np.array(SIDES) / 2.0 - vertex) / np.sqrt(3.0)
    hits = [
        Hit(0.0, corner.position, 1.5 * corner.inward),
        Hit(0.3, side.position, 0.5 * side.inward),
        Hit(0.15, side.position, 2.0 * side.inward),
        Hit(0.3, vertex, 0.25 * inward),
    ]
    sound, rate = soundfile.read(out)
    seconds = len(sound) / rate
    assert seconds > 0.3 + 0.5
    expected = render(solid, hits, seconds, rate, 0.0, Listening.of_design(design, solid))
    np.testing.assert_allclose(sound, expected, atol=1e-6 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("lines", "complaint"),
    [
        ([], "has no strikes, expected a line that names columns"),
        ([HEADER], "has no strikes"),
        (["time_seconds,where", "0,corner"], "line 1: found the column 'where', expected some of"),
        (["target", "corner"], "line 1: there is no column time_seconds"),
        (["target,target,time_seconds", "a,a,0"], "line 1: the column target is there twice"),
        ([HEADER, LINES[0], "0,corner"], "line 3: found 2 values, expected 7"),
        ([HEADER, ",corner,,,,,"], "line 2: expected a number in the column time_seconds"),
        ([HEADER, "soon,corner,,,,,"], "line 2: time_seconds: found 'soon', expected a number"),
        ([HEADER, "-1,corner,,,,,"], "line 2: time_seconds: found '-1'"),
        ([HEADER, "nan,corner,,,,,"], "line 2: time_seconds: found 'nan'"),
        ([HEADER, "1e9,corner,,,,,"], "line 2: time_seconds: found '1e9', .* 0 to 600"),
        ([HEADER, "0,,,,,,"], "line 2: expected one place, .* found nothing"),
        ([HEADER, "0,corner,1,,,,"], "line 2: expected one place, .* found target and vertex"),
        ([HEADER, "0,,,1,,3,"], "line 2: expected numbers in all of x, y, z, found x, z"),
        ([HEADER, "0,,1.5,,,,"], "line 2: vertex: found '1.5', expected a whole number"),
        ([HEADER, "0,,999999,,,,"], "line 2': there is no vertex 999999"),
        ([HEADER, "0,corner,,,,,0"], "line 2: strength_newton_seconds: found '0'"),
        ([HEADER, LINES[0], "0,lid,,,,,"], "line 3: the design has no target 'lid', expected one"),
        ([HEADER, LINES[0], "0,,,9,9,9,"], "line 3': the point .* as far from the surface"),
        ([HEADER, 'a"b,"corner'], "line 2"),
        ([HEADER, *["0,corner,,,,,"] * 10_001], "line 10002: more than 10,000 strikes"),
    ],
)
def test_bad_lines_are_refused_with_their_number(tmp_path, lines, complaint, refuses):
    write_design(tmp_path / "design.h5", small_design())
    path = written(tmp_path, *lines)
    words = ["render", tmp_path / "design.h5", "--strikes", path, "--out", tmp_path / "all.wav"]
    said = refuses(main, *words)
    assert "strikes.csv" in said and re.search(complaint, said)
    assert not (tmp_path / "all.wav").exists()


def test_what_is_no_list_is_refused(tmp_path, refuses):
    write_design(tmp_path / "design.h5", small_design())
    (tmp_path / "large.csv").write_bytes(b"0" * ((1 << 22) + 1))
    for name, complaint in (
        ("absent.csv", "no such file"),
        (".", "is a folder"),
        ("design.h5", "is no text"),
        ("large.csv", "longer than 4,194,304 bytes"),
    ):
        words = ["--strikes", tmp_path / name, "--out", tmp_path / "all.wav"]
        assert complaint in refuses(main, "render", tmp_path / "design.h5", *words)
    words = ["--strikes", written(tmp_path, HEADER, *LINES), "--out", tmp_path / "all.wav"]
    words += ["--impulse", 1, 0, 0]
    assert "give strengths in the list" in refuses(main, "render", tmp_path / "design.h5", *words)
