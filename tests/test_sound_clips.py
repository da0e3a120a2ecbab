"""Sound files are read and written as they should be; synthesised clips sound as they say."""

import json
import os
import re
import struct
from collections.abc import Callable

import numpy as np
import pytest
import soundfile

from carillon.errors import UserError
from sound.__main__ import main
from sound.bounds import MOST_CHANNELS, MOST_CLIP_SAMPLES, MOST_SAMPLES, require_length
from sound.clips.extraction import extract
from sound.clips.formats import CLIP_FORMATS
from sound.clips.instruments import INSTRUMENTS, note_hertz, synthesised
from sound.clips.wav import PEAK, read_wav, write_wav
from sound.commands.clip import NAMES
from sound.synthesis.sinusoids import damped_sinusoids

RATE = 8000


@pytest.fixture
def samples() -> np.ndarray:
    one = np.ones(1)
    return damped_sinusoids(440.0 * one, 9.0 * one, 0.5 * one, 0.0 * one, RATE, RATE // 2)


@pytest.mark.parametrize(("subtype", "step"), [("PCM_U8", 8), ("PCM_16", 16), ("PCM_24", 24)])
@pytest.mark.parametrize("rate", [8000, 96_000])
def test_integer_samples_are_read_to_their_rounding(tmp_path, samples, subtype, step, rate):
    soundfile.write(tmp_path / "clip.wav", samples, rate, subtype=subtype)
    read, found_rate = read_wav(tmp_path / "clip.wav")
    assert found_rate == rate
    assert np.abs(read - samples).max() <= 2.0 ** (1 - step)


def test_the_loudest_channel_that_is_clipped_least_is_read(tmp_path, samples):
    clipped = np.clip(6.0 * samples, -1.0, 1.0)
    for channels in ([0.5 * samples, samples], [samples, -0.9 * samples], [clipped, samples]):
        soundfile.write(tmp_path / "clip.wav", np.stack(channels, axis=1), RATE, subtype="DOUBLE")
        np.testing.assert_allclose(read_wav(tmp_path / "clip.wav")[0], samples, atol=1e-12)


def test_clipped_samples_can_be_allowed(tmp_path, samples):
    clipped = np.clip(6.0 * samples, -1.0, 1.0)
    soundfile.write(tmp_path / "clip.wav", clipped, RATE, subtype="DOUBLE")
    np.testing.assert_allclose(read_wav(tmp_path / "clip.wav", True)[0], clipped, atol=1e-12)


def test_what_is_written_is_read(tmp_path, samples):
    write_wav(tmp_path / "float.wav", 3.0 * samples, RATE)
    write_wav(tmp_path / "peak.wav", samples, RATE, peak=True)
    np.testing.assert_allclose(read_wav(tmp_path / "float.wav")[0], 3.0 * samples, atol=1e-7)
    peak = read_wav(tmp_path / "peak.wav")[0]
    assert soundfile.info(tmp_path / "peak.wav").subtype == "FLOAT"
    np.testing.assert_allclose(peak, samples * PEAK / np.abs(samples).max(), atol=1e-7)


def test_sound_that_a_file_cannot_hold_is_not_written(tmp_path, samples):
    with pytest.raises(UserError, match="not finite"):
        write_wav(tmp_path / "out.wav", np.full(9, np.nan), RATE)
    with pytest.raises(UserError, match="more than its samples hold"):
        write_wav(tmp_path / "out.wav", np.full(9, 1e300), RATE)
    with pytest.raises(UserError, match="expected a name that ends in .wav"):
        write_wav(tmp_path / "out.mp3", samples, RATE)
    assert not list(tmp_path.iterdir())


def test_loud_but_unclipped_sound_is_read(tmp_path, samples):
    loud = samples / np.abs(samples).max()
    soundfile.write(tmp_path / "clip.wav", loud, RATE, subtype="PCM_16")
    assert np.abs(read_wav(tmp_path / "clip.wav")[0]).max() > 0.9999


def bad_clips(samples: np.ndarray) -> dict[str, tuple[np.ndarray, str]]:
    clipped = np.clip(6.0 * samples, -1.0, 1.0)
    count = np.count_nonzero(np.abs(clipped) == 1.0)
    broken = samples.copy()
    broken[[5, 7]] = np.nan, np.inf
    return {
        "silent": (np.zeros(100), "is silent"),
        "empty": (np.zeros(0), "has no samples"),
        "clipped": (clipped, rf"is clipped \({count} samples at full scale"),
        "broken": (broken, "has samples that are not finite numbers .*, 2 of"),
        "loud": (1e300 * samples, r"reaches .*e\+299 times full scale, expected at most 1e\+06"),
        "louder": (np.sign(samples) * np.finfo(float).max, "times full scale"),
        "faint": (1e-300 * samples, "is silent, or nearly so"),
        "crowded": (np.stack([samples] * (MOST_CHANNELS + 1), axis=1), "has 17 channels"),
    }


@pytest.mark.parametrize("case", bad_clips(np.zeros(9)))
def test_bad_clips_are_answered_in_one_sentence(tmp_path, samples, case):
    content, message = bad_clips(samples)[case]
    path = tmp_path / "clip.wav"
    soundfile.write(path, content, RATE, subtype="DOUBLE")
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


@pytest.mark.parametrize("name", ["c.raw", "c.RAW", "c.wav", "c"])
def test_samples_without_a_header_are_answered_in_one_sentence(tmp_path, samples, name):
    path = tmp_path / name
    path.write_bytes(samples.astype("<i2").tobytes())
    with pytest.raises(UserError) as caught:
        read_wav(path)
    formats = r"\(WAV, FLAC, Ogg, AIFF or MP3\)"
    assert re.fullmatch(rf"{path}: [^\n]*expected a sound clip {formats}[^\n]*", str(caught.value))


@pytest.mark.parametrize("ending", ["flac", "ogg", "aiff", "mp3"])
def test_the_formats_that_are_named_are_read(tmp_path, samples, ending):
    assert ending in CLIP_FORMATS.lower()
    path = tmp_path / f"clip.{ending}"
    soundfile.write(path, samples, RATE)
    assert read_wav(path)[1] == RATE


def with_field(field: bytes, offset: int, value: int) -> Callable[[bytes], bytes]:
    """Changes a number of four bytes behind the name of a chunk."""

    def change(content: bytes) -> bytes:
        place = content.index(field) + offset
        return content[:place] + struct.pack("<I", value) + content[place + 4 :]

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (with_field(b"fmt ", 12, 0), "is not readable as a sound file"),
        (with_field(b"fmt ", 12, 999), "has 999 samples per second, expected 1,000 to 768,000"),
        (with_field(b"fmt ", 12, 768_001), "has 768,001 samples per second"),
        (with_field(b"fmt ", 12, 2**31 - 1), "has 2,147,483,647 samples per second"),
        (with_field(b"data", 4, 10**9), "ends before the samples that it claims to hold"),
        (lambda content: content[: len(content) // 2], "ends before the samples"),
        (lambda content: content[:20], "is not readable as a sound file"),
        (lambda content: b"", "is not readable as a sound file"),
    ],
)
def test_headers_that_lie_are_refused(tmp_path, samples, change, message):
    path = tmp_path / "clip.wav"
    soundfile.write(path, samples, RATE, subtype="DOUBLE")
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(UserError, match=message):
        read_wav(path)


def test_a_length_that_its_writer_did_not_know_is_none_to_be_missed(tmp_path, samples):
    path = tmp_path / "clip.wav"
    soundfile.write(path, samples, RATE, subtype="PCM_16")
    path.write_bytes(with_field(b"data", 4, 0xFFFF_FFFF)(path.read_bytes()))
    assert len(read_wav(path)[0]) == len(samples)


def test_hours_of_sound_are_refused_before_they_are_read(tmp_path):
    path = tmp_path / "clip.wav"
    soundfile.write(path, np.zeros(1), RATE, subtype="PCM_16")
    length = 2 * (MOST_CLIP_SAMPLES + 1)
    content = with_field(b"data", 4, length)(path.read_bytes())
    path.write_bytes(content)
    os.truncate(path, content.index(b"data") + 8 + length)
    with pytest.raises(UserError, match="lasts 1,049 s, .*expected a single strike"):
        read_wav(path)


def test_what_is_no_file_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.wav")
    (tmp_path / "loop.wav").symlink_to("loop.wav")
    (tmp_path / "zeros.wav").symlink_to("/dev/zero")
    for name in ("pipe.wav", "loop.wav", "zeros.wav", ".", "x" * 300 + ".wav", "a\0b.wav"):
        with pytest.raises(UserError, match="expected a sound clip"):
            read_wav(tmp_path / name)


CLIP = ("clip", "wood", "--out", "hit.wav")


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (["clip", "wood", "--out", "hit.mp3"], "hit.mp3: ends in .mp3, expected .* .wav"),
        (["clip", "wood", "--out", "hit"], "hit: ends in nothing, expected .* .wav"),
        ([*CLIP, "--note", ""], "'' is not a note"),
        ([*CLIP, "--rate", "1e11"], "expected a whole number"),
        ([*CLIP, "--rate", "768001"], "expected at most 768,000"),
        ([*CLIP, "--seed", str(2**64)], "expected at most 9,223"),
        (["extract", "end.wav", "--residual", "x.mp3"], "x.mp3: ends in .mp3"),
        (["extract", "end.wav", "--residual", "end.wav"], "is an input and would be replaced"),
        (["extract", "end.wav", "--residual", "./end.wav"], "is an input and would be replaced"),
        (["extract", "end.wav", "--out", "x.wav"], "x.wav: ends in .wav, expected .* .json"),
        (["extract", "end.wav", "--residual", ""], "ends in nothing"),
    ],
)
def test_names_of_results_tell_what_is_in_them(
    tmp_path, monkeypatch, samples, words, complaint, refuses
):
    monkeypatch.chdir(tmp_path)
    write_wav("end.wav", samples, RATE)
    before = (tmp_path / "end.wav").read_bytes()
    assert re.search(complaint, refuses(main, *words))
    assert [path.name for path in tmp_path.iterdir()] == ["end.wav"]
    assert (tmp_path / "end.wav").read_bytes() == before


def test_sounds_have_a_sample_and_no_more_than_memory_holds():
    require_length(1.0, 44_100)
    for seconds in (1e-300, 1.01 * MOST_SAMPLES / 44_100, 1e300):
        with pytest.raises(UserError, match="samples, expected 1 to"):
            require_length(seconds, 44_100)


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
    sharpness = piano / (np.round(piano / piano[0]) * piano[0])
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
    printed = json.loads(capsys.readouterr().out)
    sound = extract(*read_wav(path))
    np.testing.assert_allclose(sound.frequencies, printed["frequencies_hz"], rtol=1e-3)
    np.testing.assert_allclose(sound.dampings, printed["dampings_per_second"], rtol=0.05)
    np.testing.assert_allclose(sound.amplitudes, printed["amplitudes"], rtol=0.05)
    assert printed["frequencies_hz"][0] == pytest.approx(note_hertz("G4"))


@pytest.mark.parametrize("seconds", ["1e-5", "1e9"])
def test_clips_have_a_sensible_length(tmp_path, seconds, refuses):
    words = ("clip", "wood", "--seconds", seconds, "--out", tmp_path / "wood.wav")
    assert re.search("--seconds .* expected 0.0058 to 60", refuses(main, *words))
