"""How loud sounds are that are rendered to files, how they end, and how they are rounded."""

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import soundfile

from sound.__main__ import main
from sound.clips.extraction import extract
from sound.clips.targets import ClipLoudness, share_frequencies
from sound.clips.wav import as_wav, write_wav
from sound.levels import (
    FULL,
    dithered,
    end_dbfs,
    faded,
    limited,
    limiting_gains,
    loudness_lufs,
    relative_loudness,
)
from sound.project.design import Design
from sound.project.design_file import read_design, write_design
from sound.rendering.listening import Listening
from sound.rendering.render import Hit
from sound.rendering.rendered_sound import LONGEST_SECONDS, LevelOptions, render_sound
from sound.rendering.solid import SoundingSolid
from tests.small_design import N_MODES, small_design

RATE = 44_100


def tone(hertz: float, seconds: float, rate: int) -> np.ndarray:
    return np.sin(2.0 * np.pi * hertz * np.arange(round(seconds * rate)) / rate)


@pytest.mark.parametrize("rate", [4_000, 8_000, 44_100, 48_000, 96_000])
def test_loudness_is_that_of_the_standard(rate):
    """A sine of 997 Hz at full scale in one channel has -3.01 LUFS (BS.1770, annex 1)."""
    assert loudness_lufs(tone(997.0, 2.0, rate), rate) == pytest.approx(-3.01, abs=0.05)
    both = np.stack([tone(997.0, 2.0, rate)] * 2, axis=1)
    assert loudness_lufs(both, rate) == pytest.approx(0.0, abs=0.05)


def test_loudness_of_the_gates():
    """Silence between tones does not count, nor what is below -70 LUFS."""
    loud = tone(997.0, 4.0, 48_000)
    pause = np.concatenate([loud, np.zeros(8 * 48_000), loud])
    assert loudness_lufs(pause, 48_000) == pytest.approx(loudness_lufs(loud, 48_000), abs=0.3)
    assert loudness_lufs(1e-4 * loud, 48_000) == -np.inf == loudness_lufs(0.0 * loud, 48_000)
    assert relative_loudness(1e-4 * loud, 48_000) == pytest.approx(-83.01, abs=0.05)
    assert relative_loudness(0.0 * loud, 48_000) == -np.inf == relative_loudness(np.zeros(0), RATE)


def test_a_sound_shorter_than_a_block_is_as_loud_as_with_silence_behind_it():
    short = tone(997.0, 0.1, 48_000)
    expected = -3.01 + 10.0 * np.log10(0.1 / 0.4)
    assert loudness_lufs(short, 48_000) == pytest.approx(expected, abs=0.1)
    assert loudness_lufs(short[:1], 48_000) == -np.inf


def test_a_fade_is_where_the_end_is_loud_or_asked_for():
    loud, low = np.ones((RATE, 2)), 1e-3 * np.ones(RATE)
    samples, seconds = faded(loud, RATE)
    assert seconds == pytest.approx(0.1) and not samples[-1].any()
    assert (samples[: -round(0.1 * RATE)] == 1.0).all() and (np.diff(samples[:, 0]) <= 0.0).all()
    assert faded(low, RATE)[1] == 0.0 and faded(loud, RATE, 0.0)[1] == 0.0
    assert faded(low, RATE, 0.25)[1] == 0.25 and faded(low, RATE, 9.0)[1] == 1.0
    assert faded(np.ones(20 * RATE), RATE)[1] == 0.5
    assert end_dbfs(low, RATE) == pytest.approx(-60.0)
    assert end_dbfs(np.zeros(0), RATE) == -np.inf


def test_peaks_are_attenuated_and_the_rest_stays():
    samples = np.random.default_rng(1).uniform(-0.5, 0.5, RATE)
    samples[9_000] = 7.0
    samples[30_000:30_100] *= 9.0
    gains = limiting_gains(samples, RATE)
    assert np.abs(gains * samples).max() <= FULL
    near = round(0.006 * RATE)
    for part in (slice(0, 9_000 - near), slice(9_000 + near, 30_000 - near), slice(31_000, None)):
        assert (gains[part] == 1.0).all()
    assert np.abs(np.diff(gains)).max() < 0.02
    assert (limiting_gains(0.1 * samples, RATE) == 1.0).all()


@pytest.mark.parametrize("excess", [1.5, 4.0, 10.0])
def test_attenuated_peaks_leave_a_sound_as_loud(excess):
    t = np.arange(RATE) / RATE
    samples = 0.4 * np.exp(-3.0 * t) * (tone(440.0, 1.0, RATE) + tone(1470.0, 1.0, RATE))
    samples += excess * np.exp(-300.0 * t) * tone(660.0, 1.0, RATE)
    factor, gains = limited(samples, RATE)
    held = factor * gains * samples
    assert np.abs(held).max() < 1.0
    assert loudness_lufs(held, RATE) == pytest.approx(loudness_lufs(samples, RATE), abs=0.15)


@pytest.mark.parametrize("bits", [16, 24])
def test_dither_makes_errors_that_do_not_depend_on_the_sound(tmp_path, bits):
    """Mean 0 and variance 1/4 of a step squared, even for a sound below one step (TPDF)."""
    step = 2.0 ** (1 - bits)
    for samples in (0.3 * tone(440.0, 2.0, RATE), 0.4 * step * tone(440.0, 2.0, RATE)):
        errors = dithered(samples, bits, 5) - samples / step
        assert errors.mean() == pytest.approx(0.0, abs=0.01)
        assert errors.var() == pytest.approx(0.25, rel=0.03)
        assert abs(np.corrcoef(errors, samples)[0, 1]) < 0.01
    assert not dithered(np.zeros(RATE), bits, 5).any()
    write_wav(tmp_path / "out.wav", samples, RATE, bits=bits, seed=5)
    assert soundfile.info(tmp_path / "out.wav").subtype == f"PCM_{bits}"
    np.testing.assert_array_equal(
        soundfile.read(tmp_path / "out.wav")[0] / step, dithered(samples, bits, 5)
    )
    assert as_wav(samples, RATE, bits, 5) == as_wav(samples, RATE, bits, 5)
    assert as_wav(samples, RATE, bits, 5) != as_wav(samples, RATE, bits, 6)


def struck(seconds: float, rate: int, hertz: float, decay: float, loud: float, noise: float):
    """A clip of nine partials whose phases are random, with noise that dies away; peak `loud`."""
    random = np.random.default_rng(round(hertz))
    t = np.arange(round(seconds * rate)) / rate
    f = hertz * np.linspace(1.0, 3.9, 9)
    phases = random.uniform(0.0, 2.0 * np.pi, (9, 1))
    modes = np.exp(-np.outer(decay * np.linspace(1.0, 2.0, 9), t))
    modes *= np.sin(2.0 * np.pi * np.outer(f, t) + phases)
    samples = random.uniform(0.2, 1.0, 9) @ modes
    samples += noise * np.exp(-60.0 * t) * random.normal(size=len(t))
    return loud * samples / np.abs(samples).max()


CLIPS = {
    "bells": [(1.2, 22_050, 500.0, 4.0, 0.98, 0.2), (0.8, 16_000, 410.0, 9.0, 0.3, 0.05)],
    "sustained": [(2.0, 11_025, 330.0, 0.5, 0.99, 0.01), (1.5, 8_000, 290.0, 0.8, 0.02, 0.01)],
    "short": [(0.08, 96_000, 900.0, 60.0, 0.9, 0.3), (0.15, 44_100, 700.0, 90.0, 0.5, 1.0)],
}
"""Clips of three designs: length [s], rate [Hz], lowest partial [Hz], decay [1/s], peak, noise."""


@cache
def design_of(kind: str) -> Design:
    """A design that was never searched, so that its modes are others than those of its clips."""
    sounds = [extract(struck(*values), values[1]) for values in CLIPS[kind]]
    targets = share_frequencies(("corner", "side"), sounds, N_MODES)
    return replace(small_design(), targets=targets)


@pytest.mark.parametrize("kind", CLIPS)
def test_a_strike_at_a_target_is_as_loud_as_its_clip(tmp_path, kind, capsys):
    write_design(tmp_path / "design.h5", design_of(kind))
    for name, values in zip(("corner", "side"), CLIPS[kind]):
        out, alone = tmp_path / "hit.wav", tmp_path / "modes.wav"
        files = ["--out", str(out), "--modes-out", str(alone)]
        words = ["render", str(tmp_path / "design.h5"), "--target", name, *files, "--json"]
        assert main(words) == 0
        told = json.loads(capsys.readouterr().out)
        clip, rate = struck(*values), values[1]
        sound, own = soundfile.read(out)
        seconds = min(len(clip) / rate, len(sound) / own)
        heard = loudness_lufs(sound[: round(seconds * own)], own)
        assert heard == pytest.approx(loudness_lufs(clip[: round(seconds * rate)], rate), abs=1.0)
        assert np.abs(sound).max() < 1.0 and np.abs(soundfile.read(alone)[0]).max() < 1.0
        assert told["loudness_lufs"] == pytest.approx(loudness_lufs(sound, own), abs=0.01)
        assert told["peak_dbfs"] == pytest.approx(20.0 * np.log10(np.abs(sound).max()), abs=0.01)
        assert told["end_dbfs"] <= -60.0 or told["fade_seconds"] > 0.0 and told["cut_off"]
        assert told["loudness_over_clip_lufs"] == pytest.approx(told["clip_loudness_lufs"], abs=0.5)


def heard_of(design: Design) -> tuple[SoundingSolid, Listening, Hit]:
    solid = SoundingSolid.of_design(design)
    strike = design.strikes[0]
    return solid, Listening.of_design(design, solid), Hit(0.0, strike.position, strike.inward)


def test_noise_of_a_clip_stays_as_it_is():
    _, listening, _ = heard_of(design_of("bells"))
    assert listening.noise_gains == pytest.approx([1.0, 1.0], abs=0.1)


def test_a_design_of_before_is_as_loud_as_its_modes_and_its_residual():
    """Its file does not hold the loudness of its clips."""
    design = small_design()
    assert design.targets.loudness is None
    solid, listening, hit = heard_of(design)
    one = render_sound(solid, [hit], 1.0, listening=listening, options=LevelOptions(raw=True))
    targets, t = design.targets, np.arange(RATE) / RATE
    clip = targets.amplitudes[0] @ (
        np.exp(-np.outer(targets.dampings, t))
        * np.sin(2.0 * np.pi * np.outer(targets.frequencies, t))
    )
    clip[: len(targets.residuals[0])] += targets.residuals[0]
    first = round(0.4 * RATE)
    expected = loudness_lufs(clip[:first], RATE)
    assert loudness_lufs(one.samples[:first], RATE) == pytest.approx(expected, abs=0.5)


def test_the_loudness_of_clips_is_kept_with_a_design(tmp_path):
    design = design_of("short")
    write_design(tmp_path / "design.h5", design)
    kept = read_design(tmp_path / "design.h5").targets.loudness
    assert kept is not None and design.targets.loudness is not None
    np.testing.assert_array_equal(kept.lufs, design.targets.loudness.lufs)
    assert kept.seconds == pytest.approx([0.08, 0.15], abs=0.01)


@pytest.mark.parametrize(("lufs", "seconds"), [(-20.0, 0.0), (-20.0, -1.0), (1e300, 1.0)])
def test_impossible_loudness_is_refused(tmp_path, lufs, seconds):
    design = design_of("short")
    wrong = ClipLoudness(np.full(2, lufs), np.full(2, seconds))
    with pytest.raises(ValueError, match="holds loudness of clips beyond 400 LUFS, or lengths"):
        write_design(
            tmp_path / "d.h5", replace(design, targets=replace(design.targets, loudness=wrong))
        )


@pytest.mark.parametrize("strength", [1e-3, 0.5, 3.0, 1e3])
def test_a_strike_is_within_full_scale_whatever_its_strength(strength):
    solid, listening, hit = heard_of(design_of("bells"))
    hits = [replace(hit, impulse=strength * hit.impulse)]
    raw = render_sound(solid, hits, listening=listening, options=LevelOptions(raw=True))
    sound = render_sound(solid, hits, listening=listening)
    assert np.abs(sound.samples).max() < 1.0 and raw.scale == 1.0
    assert sound.level.end_dbfs <= -60.0 and sound.level.fade_seconds == 0.0
    assert np.abs(sound.samples[-round(0.1 * RATE) :]).max() <= 1e-3 * min(
        1.0, np.abs(sound.samples).max()
    )
    if np.abs(raw.samples).max() <= FULL:
        np.testing.assert_array_equal(sound.samples, raw.samples[: len(sound.samples)])
    else:
        assert sound.limited_decibels > 0.0 or sound.scale < 1.0
        assert sound.scale * strength > 0.9 or sound.scale > 0.9


def test_what_rings_on_beyond_the_limit_fades():
    design = small_design()
    slow = replace(design.targets, dampings=np.full(N_MODES, 0.01))
    solid, listening, hit = heard_of(replace(design, targets=slow))
    sound = render_sound(solid, [hit], listening=listening)
    assert sound.cut_off and sound.level.fade_seconds == 0.5 and sound.level.end_dbfs > -60.0
    assert len(sound.samples) == pytest.approx(LONGEST_SECONDS * RATE, abs=0.2 * RATE)
    assert abs(sound.samples[-1]) < 1e-12
    cut = render_sound(solid, [hit], 1.0, listening=listening)
    assert not cut.cut_off and cut.level.fade_seconds == pytest.approx(0.1)
    plain = LevelOptions(fade_seconds=0.0)
    sharp = render_sound(solid, [hit], 1.0, listening=listening, options=plain)
    assert sharp.level.fade_seconds == 0.0 and np.abs(sharp.samples[-500:]).max() > 1e-3


def test_silence_is_told(tmp_path, capsys):
    design = replace(
        small_design(), targets=replace(small_design().targets, residuals=(np.zeros(0),) * 2)
    )
    write_design(tmp_path / "design.h5", design)
    lowest = design.frequencies.min()
    assert lowest > 500.0
    words = ["render", str(tmp_path / "design.h5"), "--target", "side", "--rate", "1000"]
    assert main([*words, "--out", str(tmp_path / "hit.wav")]) == 0
    assert "silent" in capsys.readouterr().out
    assert main([*words, "--out", str(tmp_path / "hit.wav"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["loudness_lufs"] is told["peak_dbfs"] is told["clip_loudness_lufs"] is None


def test_whole_numbers_hold_no_sound_beyond_full_scale(tmp_path, refuses):
    write_design(tmp_path / "design.h5", design_of("bells"))
    words = ["render", tmp_path / "design.h5", "--target", "corner", "--out", tmp_path / "hit.wav"]
    said = refuses(main, *words, "--raw", "--strength", 50, "--bits", 16)
    assert "more than whole numbers of 16 bits hold; write 32 bits, or a fainter sound" in said
    assert not (tmp_path / "hit.wav").exists()
    assert main([str(word) for word in [*words, "--strength", 50, "--bits", 16]]) == 0
    assert soundfile.info(tmp_path / "hit.wav").subtype == "PCM_16"
