"""Sound files are read and written as they should be; synthesised clips sound as they say."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest
import soundfile

from carillon.errors import UserError
from sound.__main__ import main
from sound.clips.clip_command import NAMES
from sound.clips.damped import damped_sinusoids
from sound.clips.extraction import extract
from sound.clips.instruments import INSTRUMENTS, note_hertz, synthesised
from sound.clips.wav import CLIPPED_RUN, PEAK, read_wav, write_wav

RATE = 8000


@pytest.fixture
def samples() -> np.ndarray:
    one = np.ones(1)
    return damped_sinusoids(440.0 * one, 9.0 * one, 0.5 * one, 0.0 * one, RATE, RATE // 2)


@pytest.mark.parametrize(("subtype", "step"), [("PCM_U8", 8), ("PCM_16", 16), ("PCM_24", 24)])
@pytest.mark.parametrize("rate", [8000, 96_000])
def test_integer_samples_are_read_to_their_rounding(tmp_path, samples, subtype, step, rate):
    soundfile.write(tmp_path / "clip.wav", samples, rate, subtype=subtype)
    found, found_rate = read_wav(tmp_path / "clip.wav")
    assert found_rate == rate
    assert np.abs(found - samples).max() <= 2.0 ** (1 - step)


def test_channels_are_averaged(tmp_path, samples):
    stereo = np.stack([samples, 0.5 * samples], axis=1)
    soundfile.write(tmp_path / "clip.wav", stereo, RATE, subtype="DOUBLE")
    np.testing.assert_allclose(read_wav(tmp_path / "clip.wav")[0], 0.75 * samples, atol=1e-12)


def test_what_is_written_is_read(tmp_path, samples):
    write_wav(tmp_path / "float.wav", 3.0 * samples, RATE)
    write_wav(tmp_path / "short.wav", samples, RATE, "16 bit", peak=True)
    np.testing.assert_allclose(read_wav(tmp_path / "float.wav")[0], 3.0 * samples, atol=1e-7)
    short = read_wav(tmp_path / "short.wav")[0]
    assert soundfile.info(tmp_path / "short.wav").subtype == "PCM_16"
    np.testing.assert_allclose(short, samples * PEAK / np.abs(samples).max(), atol=2.0**-15)


def test_sound_that_16_bits_cannot_hold_is_not_written(tmp_path, samples):
    with pytest.raises(UserError, match="16 bits hold up to 1"):
        write_wav(tmp_path / "out.wav", 3.0 * samples, RATE, "16 bit")
    with pytest.raises(UserError, match="not finite"):
        write_wav(tmp_path / "out.wav", np.full(9, np.nan), RATE)
    assert not list(tmp_path.iterdir())


def test_loud_but_unclipped_sound_is_read(tmp_path, samples):
    loud = samples / np.abs(samples).max()
    soundfile.write(tmp_path / "clip.wav", loud, RATE, subtype="PCM_16")
    assert np.abs(read_wav(tmp_path / "clip.wav")[0]).max() > 0.9999


def bad_clips(samples: np.ndarray) -> dict[str, tuple[np.ndarray, str]]:
    clipped = np.clip(6.0 * samples, -1.0, 1.0)
    starts = np.flatnonzero(np.diff(clipped, prepend=0.0, append=0.0))
    runs = [b - a for a, b in pairwise(starts) if abs(clipped[a]) == 1.0 and b - a >= CLIPPED_RUN]
    broken = samples.copy()
    broken[[5, 7]] = np.nan, np.inf
    return {
        "silent": (np.zeros(100), "is silent"),
        "empty": (np.zeros(0), "has no samples"),
        "clipped": (clipped, rf"is clipped \({sum(runs)} samples at full scale"),
        "broken": (broken, "has 2 samples that are not finite"),
        "cancelling": (np.stack([samples, -samples], axis=1), "is silent once"),
    }


@pytest.mark.parametrize("case", ["silent", "empty", "clipped", "broken", "cancelling"])
def test_bad_clips_are_answered_in_one_sentence(tmp_path, samples, case):
    content, message = bad_clips(samples)[case]
    path = tmp_path / "clip.wav"
    soundfile.write(path, content, RATE, subtype="FLOAT")
    with pytest.raises(UserError, match=message) as error:
        read_wav(path)
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)


def test_missing_and_other_files_are_answered_in_one_sentence(tmp_path):
    with pytest.raises(UserError, match="no such file"):
        read_wav(tmp_path / "none.wav")
    (tmp_path / "text.wav").write_text("no sound")
    with pytest.raises(UserError, match="not readable as a sound file"):
        read_wav(tmp_path / "text.wav")


def test_notes_are_in_equal_temperament():
    assert note_hertz("A4") == 440.0
    assert note_hertz("A3") == 220.0
    np.testing.assert_allclose(
        [note_hertz(note) for note in ("C4", "E4", "G4", "F3")],
        [261.63, 329.63, 392.00, 174.61],
        atol=0.005,
    )
    assert note_hertz("C#4") == pytest.approx(note_hertz("Db4"))
    for wrong in ("H4", "c4", "C", "C44"):
        with pytest.raises(UserError, match="is not a note"):
            note_hertz(wrong)


def test_every_instrument_can_be_asked_for():
    assert set(NAMES) == set(INSTRUMENTS)


@pytest.mark.parametrize("instrument", NAMES)
def test_instruments_depend_on_their_seed_alone(instrument):
    first, again, other = (synthesised(instrument, 300.0, 0.2, RATE, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.modal_part(), again.modal_part())
    np.testing.assert_array_equal(first.residual, again.residual)
    assert not np.array_equal(first.residual, other.residual)
    assert first.frequencies[0] == pytest.approx(300.0, rel=0.02)
    assert (np.diff(first.frequencies) > 0.0).all()
    assert (first.dampings > 0.0).all()


def test_wood_dies_away_sooner_than_metal_and_strings_are_nearly_harmonic():
    sounds = {name: synthesised(name, 300.0, 0.2, 44_100, 0) for name in NAMES}
    assert sounds["wood"].dampings[0] > 3.0 * sounds["metal"].dampings[0]
    piano = sounds["piano"].frequencies
    numbers = np.round(piano / piano[0])
    sharpness = piano / (numbers * piano[0])
    assert (np.diff(sharpness) > 0.0).all()
    assert sharpness[-1] < 1.1
    metal = sounds["metal"].frequencies / sounds["metal"].frequencies[0]
    assert np.abs(metal - np.round(metal)).max() > 0.2


def test_pitch_must_be_sampled():
    with pytest.raises(UserError, match="cannot be sampled at 8000 Hz"):
        synthesised("metal", 3900.0, 1.0, RATE, 0)


def test_clip_command_writes_the_partials_it_prints(tmp_path, capsys):
    path = tmp_path / "piano.wav"
    options = ["--note", "G4", "--rate", "8000", "--seconds", "1", "--seed", "3", "--json"]
    assert main(["clip", "piano", *options, "--out", str(path)]) == 0
    told = json.loads(capsys.readouterr().out)
    found = extract(*read_wav(path))
    np.testing.assert_allclose(found.frequencies, told["frequencies_hz"], rtol=1e-3)
    np.testing.assert_allclose(found.dampings, told["dampings_per_second"], rtol=0.05)
    np.testing.assert_allclose(found.amplitudes, told["amplitudes"], rtol=0.05)
    assert told["frequencies_hz"][0] == pytest.approx(note_hertz("G4"))


@pytest.mark.parametrize("seconds", ["1e-5", "1e9"])
def test_clips_have_a_sensible_length(tmp_path, seconds):
    with pytest.raises(UserError, match="--seconds .* expected 0.0058 to 60"):
        main(["clip", "wood", "--seconds", seconds, "--out", str(tmp_path / "wood.wav")])
