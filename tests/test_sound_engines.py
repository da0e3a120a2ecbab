"""What game engines and browsers take of a design: folders of sounds, tables of modes, modules."""

import base64
import csv
import io
import json
import shutil
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import soundfile

from sound.__main__ import main
from sound.export.full_scale import loudest_peak
from sound.export.mastering import onset_gains
from sound.export.modal_model import ModalModel
from sound.export.placing import STAGING
from sound.export.sound_set import NEARBY, added_contact
from sound.project.design_file import write_design
from sound.rendering.listening import Listening
from sound.rendering.render import Hit, render
from sound.rendering.solid import SoundingSolid
from studio.processes.exports import Exports
from tests.chromium import chromium, served
from tests.gltf_files import validated
from tests.programs import run
from tests.small_design import N_MODES, SIDES, small_design

RATE = 44_100
FEW = ["--strengths", "1", "0.25", "--variations", "2", "--rate", "22050"]
POINTS = ("corner", "side")
SOUNDS = [f"pan_{point}_s{s}_v{v}.wav" for point in POINTS for s in (1, 2) for v in (1, 2)]
MODELS = [
    "pan-modes.csv",
    "pan-modes.json",
    "pan.dsp",
    "pan.glb",
    "pan.js",
    "pan_corner.impobj",
    "pan_side.impobj",
]
NODE = """
import { pathToFileURL } from "node:url";
const [path, point, strength, contact, rate, how] = process.argv.slice(-6);
const { render } = await import(pathToFileURL(path));
const strike = { strength: +strength, contactSeconds: +contact };
const samples = render(point, 0.5, +rate, { ...strike, ...JSON.parse(how) });
process.stdout.write(Buffer.from(samples.buffer).toString("base64"));
"""
BROWSER = """async ([point, strength, contact, rate, how]) => {
  const { createSolid } = await import("/pan.js");
  const context = new OfflineAudioContext(1, rate / 2, rate);
  const strikes = [{ point, strength, contactSeconds: contact }];
  const solid = await createSolid(context, { strikes, ...how });
  solid.connect(context.destination);
  const samples = (await context.startRendering()).getChannelData(0);
  return Array.from(samples);
}"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """The design `pan.h5`, and its folder for engines."""
    path = tmp_path_factory.mktemp("engines")
    write_design(path / "pan.h5", small_design())
    assert main(["export", str(path / "pan.h5"), "--out", f"{path / 'pan'}/", *FEW]) == 0
    for name in ("pan.js", "table.json", "table.csv"):
        assert main(["export", str(path / "pan.h5"), "--out", str(path / name)]) == 0
    shutil.copy(path / "pan.js", path / "pan.mjs")
    return path


def levels(folder: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO((folder / "sounds.csv").read_text())))


def rendered(point: int, strength: float, contact: float, rate: int, seconds: float) -> np.ndarray:
    """What `carillon render` makes of a strike at a target, without noise."""
    design = small_design()
    solid = SoundingSolid.of_design(design)
    strike = design.strikes[point]
    hit = Hit(0.0, strike.position, strength * strike.inward)
    listening = Listening.of_design(design, solid)
    return render(solid, [hit], seconds, rate, contact, listening, residual=False)


def test_a_folder_has_sounds_their_levels_and_models(folder):
    files = sorted(str(each.relative_to(folder / "pan")) for each in (folder / "pan").rglob("*"))
    tables = ["sounds", "sounds-wwise.txt", "sounds.csv", "sounds.json"]
    assert files == sorted([*MODELS, *tables, *(f"sounds/{each}" for each in SOUNDS)])
    assert [row["file"] for row in levels(folder / "pan")] == SOUNDS
    told = json.loads((folder / "pan/sounds.json").read_text())
    assert [row["file"] for row in told["sounds"]] == SOUNDS
    assert set(told["columns"]) == set(told["sounds"][0])


def test_wwise_gets_containers_and_volumes(folder):
    text = (folder / "pan/sounds-wwise.txt").read_text()
    rows = list(csv.DictReader(io.StringIO(text), delimiter="\t"))
    assert [row["Audio File"] for row in rows] == [f"sounds\\{file}" for file in SOUNDS]
    assert len({row["Object Path"].split("\\")[0] for row in rows}) == 4
    for row, level in zip(rows, levels(folder / "pan"), strict=True):
        assert float(row["Property[Volume]"]) == pytest.approx(float(level["gain_db"]), abs=1e-4)


def test_sounds_have_24_bits_one_peak_and_silent_ends(folder):
    for row in levels(folder / "pan"):
        path = folder / "pan/sounds" / row["file"]
        assert soundfile.info(path).subtype == "PCM_24"
        samples, rate = soundfile.read(path)
        assert rate == 22_050 and len(samples) / rate == pytest.approx(
            float(row["seconds"]), abs=1e-5
        )
        assert 20.0 * np.log10(np.abs(samples).max()) == pytest.approx(-1.0, abs=1e-3)
        assert samples[-1] == 0.0 and np.abs(samples[-20:]).max() < 1e-4
        root = 20.0 * np.log10(np.sqrt(np.mean(samples**2)))
        assert root == pytest.approx(float(row["rms_db"]), abs=1e-3)


def test_gains_make_files_as_loud_to_each_other_as_the_strikes(folder):
    rows = {row["file"]: row for row in levels(folder / "pan")}
    assert max(float(row["gain_db"]) for row in rows.values()) == 0.0
    scales = []
    design = small_design()
    solid = SoundingSolid.of_design(design)
    listening = Listening.of_design(design, solid)
    for strike in design.strikes:
        for number, strength in ((1, 0.25), (2, 1.0)):
            row = rows[f"pan_{strike.name}_s{number}_v1.wav"]
            samples, rate = soundfile.read(folder / "pan/sounds" / row["file"])
            contact = added_contact(0.0, strength)
            assert float(row["contact_seconds"]) == pytest.approx(contact, rel=1e-5)
            hit = Hit(0.0, strike.position, strength * strike.inward)
            truth = render(solid, [hit], 0.2, rate, contact, listening)
            truth *= onset_gains(truth, rate)
            start = samples[: len(truth)]
            scale = float(start @ truth / (truth @ truth))
            np.testing.assert_allclose(start, scale * truth, atol=2e-6)
            scales.append(10.0 ** (float(row["gain_db"]) / 20.0) * scale)
    np.testing.assert_allclose(scales, scales[0], rtol=1e-4)


def test_variations_are_struck_near_by_and_the_same_again(folder, tmp_path):
    rows = {row["file"]: row for row in levels(folder / "pan")}
    for strike in small_design().strikes:
        near = rows[f"pan_{strike.name}_s1_v2.wav"]
        away = np.linalg.norm([float(near[key]) for key in ("x_m", "y_m", "z_m")] - strike.position)
        assert 0.0 < away < NEARBY * max(SIDES)
    again, other = tmp_path / "again", tmp_path / "other"
    for path, seed in ((again, "0"), (other, "5")):
        words = ["--format", "folder", "--out", str(path), "--seed", seed, *FEW]
        assert main(["export", str(folder / "pan.h5"), *words]) == 0
    for file in SOUNDS:
        content = (folder / "pan/sounds" / file).read_bytes()
        assert (again / "sounds" / file).read_bytes() == content
    assert levels(other) != levels(again)


def test_a_folder_is_filled_again_beside_what_others_keep_there(folder, tmp_path):
    path = tmp_path / "pan"
    (path / "sounds").mkdir(parents=True)
    (path / "sounds/pan_corner_s1_v1.wav.meta").write_text("of an engine")
    (path / "pan.glb").write_text("of before")
    assert main(["export", str(folder / "pan.h5"), "--out", f"{path}/", *FEW]) == 0
    assert (path / "sounds/pan_corner_s1_v1.wav.meta").read_text() == "of an engine"
    assert (path / "pan.glb").read_bytes() == (folder / "pan/pan.glb").read_bytes()
    assert not [each for each in path.iterdir() if each.name.startswith(STAGING)]


def names_in(folder: Path) -> set[str]:
    files = (each for each in folder.rglob("*") if not each.is_dir())
    return {each.relative_to(folder).as_posix() for each in files}


def exported(folder: Path, design: str, path: Path, *words: str) -> int:
    return main(["export", str(folder / design), "--out", f"{path}/", *words])


def test_files_of_a_former_export_make_room_and_others_stay(folder, tmp_path, capsys):
    path, shorter = tmp_path / "pan", ["--strengths", "1", "--variations", "1", "--rate", "22050"]
    assert exported(folder, "pan.h5", path, *FEW, "--points", "1") == 0
    own = {"pan_corner_s1_v1.wav", "sounds/pan_side_s1_v1.wav.import", "sounds/own.wav", "own.js"}
    for name in own:
        (path / name).write_text("of others")
    capsys.readouterr()
    shutil.copy(folder / "pan.h5", tmp_path / "pot.h5")
    assert exported(tmp_path, "pot.h5", path, *shorter) == 0
    told = json.loads((path / "sounds.json").read_text())
    assert names_in(path) == own | set(told["files"])
    assert [row["file"] for row in told["sounds"]] == [f"pot_{point}_s1_v1.wav" for point in POINTS]
    # 12 sounds, and 5 models beside one for each of 3 points.
    assert "; 20 files of a former export removed" in capsys.readouterr().out


HOSTILE = [
    "../outside.js",
    "sounds/../../outside.js",
    "link/outside.js",
    "sounds/link.wav",
    "own.txt",
    7,
    None,
]


@pytest.mark.parametrize(
    "table",
    [
        b"{",
        b"[]",
        b"\xff",
        b"[" * 100_000,
        json.dumps({"format": "of others", "files": ["own.js"]}).encode(),
        json.dumps({"format": "carillon sound set 1", "files": 3}).encode(),
        "hostile",
    ],
)
def test_tables_that_no_export_wrote_remove_nothing(folder, tmp_path, table):
    path, outside = tmp_path / "pan", tmp_path / "outside.js"
    (path / "sounds").mkdir(parents=True)
    kept = {path / "own.js", path / "own.txt", outside}
    for file in kept:
        file.write_text("of others")
    (path / "link").symlink_to(tmp_path)
    (path / "sounds/link.wav").symlink_to(outside)
    if table == "hostile":
        files = [str(outside), *HOSTILE]
        table = json.dumps({"format": "carillon sound set 1", "files": files}).encode()
    (path / "sounds.json").write_bytes(table)
    assert exported(folder, "pan.h5", path, *FEW) == 0
    assert all(file.read_text() == "of others" for file in kept)
    assert (path / "sounds/link.wav").is_symlink() and (path / "link").is_symlink()
    assert set(SOUNDS) <= {each.name for each in (path / "sounds").iterdir()}


@pytest.mark.parametrize("failing", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_an_export_that_ends_early_leaves_the_former_one(folder, tmp_path, monkeypatch, failing):
    path = tmp_path / "pan"
    assert exported(folder, "pan.h5", path, *FEW) == 0
    before = {name: (path / name).read_bytes() for name in names_in(path)}

    def fails(*_):
        raise failing

    monkeypatch.setattr("sound.export.engine_folder.levels_csv", fails)
    status = exported(folder, "pan.h5", path, "--strengths", "1", "--variations", "1")
    assert status == (130 if isinstance(failing, KeyboardInterrupt) else 2)
    assert {name: (path / name).read_bytes() for name in names_in(path)} == before


@pytest.mark.parametrize("name", ["pan.glb", "sounds/pan_side_s1_v1.wav", "sounds.csv", "sounds"])
def test_a_folder_or_link_in_the_place_of_a_file_is_told(folder, tmp_path, name, refuses):
    path = tmp_path / "pan"
    assert exported(folder, "pan.h5", path, *FEW, "--points", "1") == 0
    taken = path / name
    shutil.rmtree(taken) if taken.is_dir() else taken.unlink()
    taken.symlink_to(tmp_path) if name == "sounds" else taken.mkdir()
    before = names_in(path)
    said = refuses(main, "export", folder / "pan.h5", "--out", f"{path}/", *FEW)
    assert f"{taken}: is a {'link' if name == 'sounds' else 'folder'}" in said
    assert names_in(path) == before


def test_a_file_in_the_place_of_the_folder_of_sounds_is_told(folder, tmp_path, refuses):
    (tmp_path / "pan").mkdir()
    (tmp_path / "pan" / "sounds").touch()
    said = refuses(main, "export", folder / "pan.h5", "--out", f"{tmp_path / 'pan'}/", *FEW)
    assert "sounds: is a file, expected a folder" in said
    assert names_in(tmp_path / "pan") == {"sounds"}


def test_a_folder_that_fails_leaves_nothing(folder, tmp_path, monkeypatch, refuses):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("sound.export.engine_folder.levels_csv", full)
    said = refuses(main, "export", folder / "pan.h5", "--out", f"{tmp_path / 'new'}/", *FEW)
    assert "No space left on device" in said and not (tmp_path / "new").exists()


def test_a_model_that_fails_does_not_take_the_sounds_along(folder, tmp_path, monkeypatch, capsys):
    from carillon.errors import UserError

    def broken(*_):
        raise UserError("no normals")

    monkeypatch.setattr("sound.export.engine_folder.write_gltf", broken)
    words = ["--out", f"{tmp_path / 'new'}/", "--json", *FEW]
    assert main(["export", str(folder / "pan.h5"), *words]) == 0
    told = capsys.readouterr()
    assert "pan.glb is left out: no normals" in told.err
    assert json.loads(told.out)["missing"] == ["pan.glb"]
    assert len(list((tmp_path / "new/sounds").iterdir())) == len(SOUNDS)


def test_folders_that_cannot_be_are_refused(folder, tmp_path, refuses):
    (tmp_path / "file").write_text("")
    said = refuses(
        main, "export", folder / "pan.h5", "--format", "folder", "--out", tmp_path / "file"
    )
    assert "is no folder" in said
    new = f"{tmp_path / 'new'}/"
    said = refuses(main, "export", folder / "pan.h5", "--out", f"{tmp_path / 'a/b'}/")
    assert "create it first" in said
    said = refuses(main, "export", folder / "pan.h5", "--out", f"{tmp_path / 'new.glb'}/")
    assert "ends in .glb, but a folder is asked for" in said
    said = refuses(main, "export", folder / "pan.h5", "--out", tmp_path)
    assert "/ for a folder" in said
    said = refuses(main, "export", folder / "pan.h5", "--out", new, "--strengths", 1, 0.5, 1)
    assert "found 1 0.5 1, expected each strength once" in said
    many = ["--points", "1000", "--variations", "32"]
    said = refuses(main, "export", folder / "pan.h5", "--out", f"{tmp_path / 'new'}/", *many)
    assert "expected at most 2,000" in said and not (tmp_path / "new").exists()


def test_a_full_disk_leaves_the_former_export_whole(folder, tmp_path, monkeypatch, refuses):
    from carillon.errors import UserError

    def full(path, *_):
        raise UserError(f"{path.name}: could not be written") from OSError(28, "No space left")

    path = tmp_path / "pan"
    assert exported(folder, "pan.h5", path, *FEW) == 0
    before = {name: (path / name).read_bytes() for name in names_in(path)}
    monkeypatch.setattr("sound.export.engine_folder.write_gltf", full)
    said = refuses(main, "export", folder / "pan.h5", "--out", f"{path}/", "--strengths", 1)
    assert "pan.glb: could not be written" in said
    assert {name: (path / name).read_bytes() for name in names_in(path)} == before


def test_the_model_of_a_folder_is_valid(folder):
    validated(folder / "pan/pan.glb")


def test_tables_have_frequencies_decays_and_amplitudes(folder):
    model = ModalModel.of_design(small_design())
    told = json.loads((folder / "table.json").read_text())
    assert told["name"] == "pan" and len(told["modes"]) == N_MODES
    columns = {key: np.array([mode[key] for mode in told["modes"]]) for key in told["modes"][0]}
    np.testing.assert_allclose(columns["frequency_hz"], small_design().frequencies)
    np.testing.assert_allclose(columns["decay_per_second"], small_design().dampings)
    np.testing.assert_allclose(np.exp(-columns["decay_per_second"] * columns["t60_seconds"]), 1e-3)
    assert [point["name"] for point in told["points"]] == ["corner", "side"]
    np.testing.assert_allclose([point["amplitudes"] for point in told["points"]], model.amplitudes)
    rows = list(csv.DictReader(io.StringIO((folder / "table.csv").read_text())))
    for number, point in enumerate(("corner", "side")):
        written = [float(row[f"amplitude_{point}"]) for row in rows]
        np.testing.assert_allclose(written, model.amplitudes[number], rtol=1e-8)
    assert set(told["units"]) >= set(columns) | {"amplitudes", "position_m", "inward"}


def test_points_have_one_name_in_files_and_columns(tmp_path):
    design = small_design()
    names = ["Läute; left_ear", "läute-left ear"]
    strikes = [replace(each, name=name) for each, name in zip(design.strikes, names, strict=True)]
    targets = replace(design.targets, names=tuple(names))
    write_design(tmp_path / "Big pan.h5", replace(design, strikes=strikes, targets=targets))
    path = tmp_path / "folder"
    words = ["--points", "1", "--strengths", "1", "--variations", "1"]
    assert exported(tmp_path, "Big pan.h5", path, *words) == 0
    points = json.loads((path / "big_pan-modes.json").read_text())["points"]
    assert [each["name"] for each in points][:2] == names
    (columns,) = list(csv.reader((path / "big_pan-modes.csv").open()))[:1]
    keys = [column.removeprefix("amplitude_") for column in columns if "amplitude" in column]
    assert keys == ["laute_left_ear", "laute_left_ear_2", points[2]["name"]]
    sounds = [f"sounds/big_pan_{key}_s1_v1.wav" for key in keys]
    objects = [f"big_pan_{key}.impobj" for key in keys]
    assert names_in(path) >= {*sounds, *objects}


def test_impact_objects_ring_as_the_points_do(folder):
    """Rows are amplitude, decay, frequency; the amplitudes of all points have one factor."""
    model = ModalModel.of_design(small_design())
    factors = []
    for number, point in enumerate(("corner", "side")):
        told = json.loads((folder / f"pan/pan_{point}.impobj").read_text())
        assert told["Version"] == 1 and len(told["ModalData"]) == 3 * N_MODES
        amplitudes, decays, hertz = np.array(told["ModalData"]).reshape(-1, 3).T
        assert (np.diff(amplitudes) <= 0.0).all() and amplitudes.sum() < 1.0 + 1e-6
        order = [int(np.argmin(np.abs(model.frequencies - each))) for each in hertz]
        np.testing.assert_allclose(decays, model.dampings[order], rtol=1e-8)
        factors += list(amplitudes / model.amplitudes[number, order])
    np.testing.assert_allclose(factors, factors[0], rtol=1e-6)


def in_node(folder: Path, point: str, strength: float, contact: float, rate: int, how: str = "{}"):
    """What `render` of the module gives, as a finished program."""
    if shutil.which("node") is None:
        pytest.skip("node is not installed")
    given = (folder / "pan.mjs", point, strength, contact, rate, how)
    return run("node", "--input-type=module", "-e", NODE, "--", *given)


@pytest.mark.parametrize(("contact", "rate"), [(0.0, RATE), (1.3e-3, 48_000)])
@pytest.mark.parametrize("point", ["corner", "side"])
def test_node_plays_what_we_render(folder, point, contact, rate):
    done = in_node(folder, point, 2.0, contact, rate, '{"gain": 1}')
    made = np.frombuffer(base64.b64decode(done.stdout))
    truth = rendered(POINTS.index(point), 2.0, contact, rate, 0.5)
    np.testing.assert_allclose(made, truth, atol=1e-9 * np.abs(truth).max())


def test_a_browser_plays_what_we_render(folder):
    with chromium() as browser, served(folder) as address:
        page = browser.new_page()
        page.goto(address)
        gain = page.evaluate("async () => (await import('/pan.js')).model.gain")
        for number, contact, how in ((0, 0.0, {}), (1, 1.3e-3, {"gain": 1.0})):
            made = np.array(page.evaluate(BROWSER, [POINTS[number], 2.0, contact, RATE, how]))
            truth = how.get("gain", gain) * rendered(number, 2.0, contact, RATE, 0.5)
            assert len(made) == len(truth)
            np.testing.assert_allclose(made, truth, atol=1e-6 * np.abs(truth).max())
        assert page.evaluate("async () => (await import('/pan.js')).model.name") == "pan"


@pytest.mark.parametrize("rate", [RATE, 48_000])
def test_a_module_s_strikes_of_1_newton_second_fill_full_scale_and_stay_within(folder, rate):
    peaks = []
    for number, point in enumerate(POINTS):
        made = np.frombuffer(base64.b64decode(in_node(folder, point, 1.0, 0.0, rate).stdout))
        peaks.append(np.abs(made).max())
        assert np.abs(rendered(number, 1.0, 0.0, rate, 0.5)).max() > peaks[-1]  # it would clip
    assert 0.95 < max(peaks) < 1.0


def test_faint_models_are_not_made_louder():
    model = ModalModel.of_design(small_design())
    peak = loudest_peak(model.frequencies, model.dampings, model.amplitudes, RATE)
    assert peak == pytest.approx(
        max(np.abs(rendered(point, 1.0, 0.0, RATE, 1.0)).max() for point in (0, 1))
    )
    gains = [replace(model, amplitudes=model.amplitudes * k).gain for k in (0.0, 1e-3, 9.0)]
    assert gains[:2] == [1.0, 1.0] and gains[2] * 9.0 == pytest.approx(model.gain)


def test_a_module_names_the_points_that_it_has(folder):
    said = in_node(folder, "lid", 1.0, 0.0, RATE).stderr
    assert "there is no point lid, expected a number below 2 or one of corner, side" in said


def test_the_studio_packs_the_folder(folder, tmp_path):
    out = tmp_path / "export.zip"
    Exports().make(str(folder / "pan.h5"), "zip", None, str(out), "my-pan")
    with zipfile.ZipFile(out) as archive:
        names = set(archive.namelist())
        assert 'declare name "my-pan";' in archive.read("my-pan/my_pan.dsp").decode()
    assert {"my-pan/my_pan.glb", "my-pan/sounds.csv", "my-pan/my_pan.js"} <= names
    assert sum(name.endswith(".wav") for name in names) == 18
