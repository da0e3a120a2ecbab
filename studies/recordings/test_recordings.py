"""Extraction on real recordings: the list, what is measured, and the pages of the study."""

import json
import re
import shutil
import subprocess
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
import soundfile
import yaml

from carillon.errors import UserError
from sound.clips.wav import write_wav
from sound.synthesis.sinusoids import damped_sinusoids
from studies.base.table import Table
from studies.recordings import index
from studies.recordings.formats import Format, differences, formats, write_as
from studies.recordings.measurement import MODES, RESIDUAL, RUN, extract, measure
from studies.recordings.packages import CONTROL, SOUNDS, bring
from studies.recordings.peaks import strong_peaks
from studies.recordings.recordings import (
    CALIBRATION,
    FOLDER,
    FORMATS,
    HELD_BACK,
    PACKAGES,
    SPLITS,
    START,
    recordings,
)
from studies.recordings.results import RecordingResults
from studies.recordings.study import RECORDING, RECORDINGS
from tests.pages import Page, assert_holds, assert_same_numbers, assert_self_contained, page_of
from workflow.__main__ import main
from workflow.commands.estimate import CONFIGURATIONS, load

RATE = 8000
FREQUENCIES = np.array([310.0, 707.0, 1433.0, 2500.0])
DAMPINGS = np.array([8.0, 12.0, 20.0, 30.0])
RINGS, SILENT = "agogo-high", "cowbell"
"""Recordings in whose place a synthesised clip lies, and one that is refused."""


def clip(seconds: float = 1.0, noise: float = 1e-4) -> np.ndarray:
    """Four modes of one level in noise."""
    levels = 0.2 * np.ones(len(FREQUENCIES))
    count = round(seconds * RATE)
    clean = damped_sinusoids(FREQUENCIES, DAMPINGS, levels, np.ones(len(levels)), RATE, count)
    return clean + noise * np.random.default_rng(0).standard_normal(count)


def test_recordings_are_many_of_several_kinds_and_both_splits():
    listed = recordings().values()
    assert len(listed) >= 30
    assert len({(each.package, each.file) for each in listed}) == len(listed)
    assert {each.split for each in listed} == set(SPLITS)
    for split in SPLITS:
        own = [each for each in listed if each.split == split]
        assert len(own) >= 15 and len({each.kind for each in own}) >= 5
        assert {each.tonal for each in own} == {True, False}
    assert all(re.fullmatch(r"[a-z0-9-]+", each.name) for each in listed)
    assert {each.package for each in listed} == set(SOUNDS)


def test_real_recordings_are_where_the_list_says(recordings_folder):
    for each in recordings().values():
        assert soundfile.info(each.path(recordings_folder)).frames > 0, each.name


def test_of_no_two_recordings_is_one_the_other_louder_but_for_the_one_that_is_said(
    recordings_folder,
):
    spectra = {}
    for each in recordings().values():
        samples, rate = soundfile.read(each.path(recordings_folder), always_2d=True, frames=10_000)
        first = np.fft.rfft(samples.mean(axis=1), 1 << 15)
        power = np.fft.irfft(np.abs(first) ** 2)[0]
        spectra[each.name] = (first / np.sqrt(power), rate)
    alike = {
        (name, other)
        for (name, (one, rate)), (other, (two, again)) in combinations(spectra.items(), 2)
        if rate == again and np.abs(np.fft.irfft(one * two.conj())).max() > 0.99
    }
    assert alike == {("wood-block-hard", "wood-block-soft")}


def test_a_real_bell_is_explained_for_the_most(recordings_folder, tmp_path):
    bell = recordings()["kenkeni-bell"].path(recordings_folder)
    assert not extract(bell, tmp_path).said
    assert json.loads((tmp_path / MODES).read_text())["clips"][0]["explained"] > 0.5


# Peaks --------------------------------------------------------------------------------------------


def test_every_mode_is_a_strong_peak_and_noise_has_none():
    peaks = strong_peaks(clip(), RATE)
    np.testing.assert_allclose(peaks.hertz, FREQUENCIES, atol=0.5 * peaks.resolution)
    assert peaks.decibels.max() == 0.0 and peaks.resolution == pytest.approx(1.0)
    assert len(strong_peaks(np.random.default_rng(1).standard_normal(RATE), RATE).hertz) == 0


def test_peaks_far_below_the_loudest_and_outside_the_range_do_not_count():
    far = damped_sinusoids(*np.array([[900.0], [5.0], [1.0], [0.0]]), RATE, RATE)
    faint = damped_sinusoids(*np.array([[2000.0], [5.0], [0.005], [0.0]]), RATE, RATE)
    low = damped_sinusoids(*np.array([[25.0], [5.0], [1.0], [0.0]]), RATE, RATE)
    high = damped_sinusoids(*np.array([[3800.0], [5.0], [1.0], [0.0]]), RATE, RATE)
    peaks = strong_peaks(far + faint + low + high, RATE)
    np.testing.assert_allclose(peaks.hertz, [900.0], atol=0.5)


def test_a_peak_is_missed_that_no_mode_is_near():
    peaks = strong_peaks(clip(), RATE)
    assert not peaks.missed(FREQUENCIES).any()
    assert peaks.missed(np.zeros(0)).all()
    assert peaks.missed(FREQUENCIES[1:]).tolist() == [True, False, False, False]
    # 20 cents of 2500 Hz are 29 Hz, half a line of this clip is 0.5 Hz.
    assert peaks.missed(FREQUENCIES + 10.0).tolist() == [True, True, False, False]
    brief = strong_peaks(clip(0.05), RATE)
    assert not brief.missed(brief.hertz + 9.0).any() and brief.missed(brief.hertz + 11.0).any()


# Packages -----------------------------------------------------------------------------------------


def program(folder: Path, name: str, text: str) -> None:
    path = folder / name
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)


def test_machines_without_apt_are_told_so(tmp_path, monkeypatch, refuses):
    monkeypatch.setenv("PATH", str(tmp_path))
    line = refuses(main, "recordings", "--out", tmp_path / "o")
    assert "no apt-get and no dpkg-deb" in line
    assert all(package in line for package in SOUNDS)


def test_without_a_network_nothing_is_left(tmp_path, monkeypatch, capsys):
    program(tmp_path, "apt-get", "echo 'E: Could not resolve host' >&2; exit 100")
    program(tmp_path, "dpkg-deb", "exit 1")
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    assert main(["recordings", "--out", str(tmp_path / "o")]) == 2
    *_, line = capsys.readouterr().err.splitlines()
    assert "(Could not resolve host); look after the network" in line
    assert not list((tmp_path / "o").iterdir())


@pytest.mark.skipif(shutil.which("dpkg-deb") is None, reason="no dpkg-deb, which makes a package")
def test_packages_are_unpacked_once_and_kept(tmp_path, monkeypatch):
    for package, folder in SOUNDS.items():
        content = tmp_path / "made" / package
        (content / folder).mkdir(parents=True)
        (content / folder / "a.wav").write_text(package)
        (content / "DEBIAN").mkdir()
        (content / "DEBIAN" / "control").write_text(
            f"Package: {package}\nVersion: 1.0\nArchitecture: all\nMaintainer: nobody\n"
            "Description: a strike\n"
        )
        command = ["dpkg-deb", "--build", str(content), str(tmp_path / f"{package}.deb")]
        subprocess.run(command, check=True, capture_output=True)
    program(tmp_path, "apt-get", f'cp "{tmp_path}/$3.deb" .')
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    monkeypatch.chdir(tmp_path)
    out = Path("o")
    out.mkdir()
    assert bring(out) == [out / package for package in SOUNDS]
    for package, folder in SOUNDS.items():
        assert (out / package / folder / "a.wav").read_text() == package
        assert "Version: 1.0" in (out / package / CONTROL).read_text()
    program(tmp_path, "apt-get", "exit 1")
    bring(out)
    (out / "sonic-pi-samples" / CONTROL).unlink()
    with pytest.raises(UserError, match="sonic-pi-samples cannot be had"):
        bring(out)
    assert not list(out.glob(".*"))


# Pages --------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """The folder of a study of two clips, one of which is refused."""
    root = tmp_path_factory.mktemp("results")
    (root / "config.yaml").write_text(yaml.safe_dump(load(CONFIGURATIONS / "laptop.yaml")))
    study = root / FOLDER
    early = np.concatenate([np.zeros(400), clip()])
    for name, channels in ((RINGS, [1.2 * early, 0.8 * early]), (SILENT, [0.0 * early])):
        results = RecordingResults(study, name)
        results.clip.parent.mkdir(parents=True)
        kind = "FLAC" if results.clip.suffix == ".flac" else "WAV"
        soundfile.write(results.clip, np.stack(channels, 1), RATE, "PCM_24", format=kind)
        results.file("").mkdir(parents=True)
        measure(results.clip, results.file(""))
    (study / START).write_text(json.dumps({"cpu_seconds": 0.5}))
    return study


def build(results: RecordingResults) -> tuple[Page, dict[str, Table]]:
    place = results.folder / results.name
    return page_of(RECORDING, results, place / "page.html"), RECORDING.made(results)


def test_what_is_measured_of_a_clip_is_what_extract_says(folder):
    results = RecordingResults(folder, RINGS)
    row = results.summary()
    told = results.found["clips"][0]
    assert row["modes"] == len(FREQUENCIES) == row["peaks"]
    assert row["missed"] == 0 and row["said"] == ""
    assert row["explained"] == pytest.approx(told["explained"], abs=1e-6) and row["explained"] > 0.9
    assert row["decibels"] == pytest.approx(-10.0 * np.log10(1.0 - row["explained"]))
    assert row["decibels_heard"] == pytest.approx(row["decibels"], abs=0.5)
    assert results.begins == pytest.approx(400, abs=8) and row["before"] < 0.2
    assert len(results.searched) == len(results.residual)
    assert row["cpu"] > 0.1 and row["cpu_rate"] == pytest.approx((row["cpu"] - 0.5) / 1.05)


def test_the_page_of_a_recording_needs_nothing_and_can_be_heard(folder):
    results = RecordingResults(folder, RINGS)
    built, made = build(results)
    assert_holds(built, RECORDING, folder / RINGS, ("modes", "provenance"))
    assert built.source.count("data:audio/wav;base64,") == 3
    assert {f"extracted/{MODES}", f"extracted/{RESIDUAL}"} <= set(built.led)
    for led in built.led:
        assert led.startswith("#") or (folder / RINGS / led).is_file()
    assert not made["missed"].rows and "missed" not in built.tables
    assert made["modes"].rows[0]["frequency"] == pytest.approx(FREQUENCIES[0], rel=1e-4)


def test_a_clip_that_is_refused_has_a_row_and_a_page_that_say_so(folder):
    results = RecordingResults(folder, SILENT)
    row = results.summary()
    assert row["said"].startswith("is silent") and not {"modes", "cpu_rate"} & set(row)
    assert {path.name for path in results.file("").iterdir()} == {RUN}


def test_the_page_of_a_refused_clip_says_why(folder, tmp_path):
    place = tmp_path / FOLDER
    shutil.copytree(folder, place)
    shutil.copy(folder.parent / "config.yaml", tmp_path)
    results = RecordingResults(place, SILENT)
    write_wav(tmp_path / "clipped.wav", np.clip(9.0 * clip(), -1.0, 1.0), RATE)
    soundfile.write(results.clip, soundfile.read(tmp_path / "clipped.wav")[0], RATE)
    run = json.loads(results.file(RUN).read_text()) | {"said": "is clipped"}
    results.file(RUN).write_text(json.dumps(run))
    built, made = build(results)
    assert_self_contained(built)
    assert list(made) == ["provenance"] and "The clip was refused: is clipped." in built.source
    assert built.source.count("data:audio/wav;base64,") == 1


def test_the_index_tells_every_recording_and_medians(folder, monkeypatch):
    chosen = {name: recordings()[name] for name in (RINGS, SILENT)}
    monkeypatch.setattr(index, "recordings", lambda: chosen)
    row = {"format": "44.1 kHz, float, mono", "said": "", "modes": 4, "strong": 4, "same": 4}
    more = {"median_cents": 0.01, "worst_cents": 0.2, "explained": 0.9}
    (folder / FORMATS).write_text(json.dumps([row | more]))
    results = index.Recordings(folder)
    shown = page_of(RECORDINGS, results, folder / "index.html")
    made = RECORDINGS.made(results)
    for name in made:
        assert_same_numbers(shown, folder / "tables", name)
    assert {f"{name}/page.html" for name in chosen} <= set(shown.led)
    assert "<script" not in shown.source
    whole = made["groups"].rows[0]
    assert (whole["split"], whole["clips"], whole["refused"]) == ("all", 2, 1)
    assert whole["modes"] == len(FREQUENCIES) and whole["missed"] == 0
    held = next(row for row in made["groups"].rows if row["split"] == HELD_BACK)
    assert held["clips"] == 0 and held["modes"] is None
    assert {row["split"] for row in made["clips"].rows} == {CALIBRATION}


# Formats ------------------------------------------------------------------------------------------


def test_each_property_of_a_format_is_changed_by_itself(tmp_path):
    made = formats(48_000)
    assert len({form.title for form in made}) == len(made) == 9
    for form in made:
        write_as(form, clip(), RATE, tmp_path / "a.wav")
        found = soundfile.info(tmp_path / "a.wav")
        assert (found.samplerate, found.subtype, found.channels) == (
            form.rate,
            form.subtype,
            form.channels,
        )


def test_a_sound_too_loud_for_a_format_is_made_less_loud(tmp_path):
    write_as(Format(RATE, "PCM_16", 2), 5.0 * clip(), RATE, tmp_path / "a.wav")
    channels, _ = soundfile.read(tmp_path / "a.wav")
    assert 0.9 < np.abs(channels).max() < 1.0
    np.testing.assert_allclose(channels[:, 1] / 0.8, channels[:, 0] / 1.2, atol=1e-4)


def test_modes_in_another_format_are_looked_for_among_the_strong_ones():
    amplitudes = [[1.0, 0.5, 0.001, 1.0]]
    reference = {"frequencies_hz": [100.0, 1000.0, 2000.0, 9000.0], "amplitudes": amplitudes}
    other = {"frequencies_hz": [100.0, 1001.0], "clips": [{"explained": 0.9}]}
    row = differences(reference, other)
    assert (row["modes"], row["strong"], row["same"]) == (2, 2, 1)
    assert row["worst_cents"] == pytest.approx(1200.0 * np.log2(1.001))


# Rules --------------------------------------------------------------------------------------------


def test_the_study_is_planned_without_the_packages(plan):
    jobs = plan("recordings")
    assert jobs["extract_recording"] == jobs["build_recording_page"] == len(recordings())
    assert jobs["bring_recordings"] == jobs["time_extraction_start"] == 1
    assert jobs["compare_formats"] == jobs["build_recordings"] == 1


def test_folders_of_packages_are_said_to_be_missing_in_one_sentence(tmp_path):
    done = extract(recordings()[RINGS].path(tmp_path / PACKAGES), tmp_path)
    assert done.said.startswith("no such file") and not list(tmp_path.iterdir())
