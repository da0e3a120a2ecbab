"""Clips share frequencies; each has its say in which modes are kept."""

import json
from dataclasses import replace

import numpy as np
import pytest

from carillon.errors import UserError
from sound.__main__ import main
from sound.clips import audibility
from sound.clips.audibility import erb_number, heard_partials
from sound.clips.extraction import ModalSound
from sound.clips.targets import APART, MOST_MODES, share_frequencies
from sound.clips.wav import read_wav, write_wav
from sound.design.resolved import RESOLVED

RATE = 8000


def sound(frequencies: list[float], amplitudes: list[float], damping: float = 5.0) -> ModalSound:
    count = len(frequencies)
    return ModalSound(
        np.array(frequencies),
        np.full(count, damping),
        np.array(amplitudes),
        np.zeros(count),
        np.arange(3.0),
        RATE,
        {},
    )


def test_modes_that_cannot_be_told_apart_are_shared():
    low, high = sound([200.0, 1000.0], [1.0, 1.0], 4.0), sound([500.0, 1001.5], [1.0, 1.0], 8.0)
    targets = share_frequencies(["low", "high"], [low, high], 3)
    np.testing.assert_allclose(targets.frequencies[:2], [200.0, 500.0])
    np.testing.assert_allclose(targets.dampings[:2], [4.0, 8.0])
    share = (targets.frequencies[2] - 1000.0) / 1.5
    assert 0.3 < share < 0.7
    assert targets.dampings[2] == pytest.approx(4.0 + 4.0 * share)
    np.testing.assert_array_equal(targets.amplitudes, [[1.0, 0.0, 1.0], [0.0, 1.0, 1.0]])
    assert targets.names == ("low", "high")
    assert targets.rates == (RATE, RATE)
    assert len(targets.residuals) == 2


def test_shared_frequency_leans_to_the_clip_that_has_more_of_it():
    strong, weak = sound([200.0, 1000.0], [0.1, 1.0]), sound([300.0, 1001.0], [1.0, 0.01])
    assert 1000.0 < share_frequencies("ab", [strong, weak]).frequencies[-1] < 1000.1


def test_modes_of_one_clip_stay_apart_and_the_closest_ones_meet():
    beating, other = sound([1000.0, 1001.0], [1.0, 1.0]), sound([1001.2], [1.0])
    targets = share_frequencies("ab", [beating, other])
    assert len(targets.frequencies) == 2
    np.testing.assert_array_equal(targets.amplitudes, [[1.0, 1.0], [0.0, 1.0]])


def test_chains_of_close_modes_do_not_become_one():
    sounds = [sound([1000.0 + 1.5 * number], [1.0]) for number in range(4)]
    targets = share_frequencies("abcd", sounds)
    assert len(targets.frequencies) == 2
    np.testing.assert_array_equal(targets.amplitudes.sum(axis=1), 1.0)


@pytest.mark.parametrize("quieter", [1.0, 1e-4])
def test_quiet_clips_are_heard(quieter):
    loud = sound([100.0 * n for n in range(1, 11)], [1.0 / n for n in range(1, 11)])
    quiet = sound([150.0, 250.0, 350.0], [quieter, quieter, 0.1 * quieter])
    targets = share_frequencies(["loud", "quiet"], [loud, quiet], 4)
    np.testing.assert_allclose(targets.frequencies, [100.0, 150.0, 200.0, 250.0])


def test_one_clip_keeps_its_strongest():
    targets = share_frequencies(["one"], [sound([1.0e3, 2.0e3, 3.0e3], [0.1, 1.0, 0.5])], 2)
    np.testing.assert_allclose(targets.frequencies, [2.0e3, 3.0e3])
    np.testing.assert_array_equal(targets.amplitudes, [[1.0, 0.5]])


def test_clips_in_another_order_give_the_same():
    first, second = sound([200.0, 700.0, 1000.0], [1, 2, 3]), sound([300.0, 1001.0], [2, 1])
    one = share_frequencies("ab", [first, second], 3)
    other = share_frequencies("ba", [second, first], 3)
    np.testing.assert_allclose(one.frequencies, other.frequencies, rtol=1e-15)
    np.testing.assert_array_equal(one.amplitudes, other.amplitudes[::-1])


def test_more_modes_than_all_clips_have_cannot_be_asked_for():
    sounds = [sound([200.0, 1000.0], [1.0, 1.0]), sound([1000.5], [1.0])]
    with pytest.raises(UserError, match="3 modes asked for, more than the 2"):
        share_frequencies(["a", "b"], sounds, 3)


def test_partials_that_nobody_hears_do_not_count():
    loud = sound([200.0, 1000.0, 1500.0], [1.0, 2e-3, 0.2])
    targets = share_frequencies(["loud"], [loud], "auto")
    np.testing.assert_allclose(targets.frequencies, [200.0, 1500.0])
    quiet = sound([300.0, 1000.0], [1e-4, 1e-4])
    targets = share_frequencies(["loud", "quiet"], [loud, quiet], "auto")
    np.testing.assert_allclose(targets.frequencies, [200.0, 300.0, 1000.0, 1500.0])
    np.testing.assert_array_equal(targets.amplitudes[:, 2], [0.0, 1e-4])


def test_partials_of_several_clips_too_close_for_a_design_count_once():
    assert APART == RESOLVED
    one, other = sound([200.0, 1000.0], [1.0, 0.6]), sound([600.0, 1002.5], [0.5, 0.4])
    targets = share_frequencies("ab", [one, other], "auto")
    assert len(targets.frequencies) == 3
    assert (targets.amplitudes > 0.0).sum(axis=1).tolist() == [2, 2]


def test_twins_are_one_partial_and_bursts_are_none():
    hertz = [1401.06, 1401.90, 2043.0, 2046.0, 2049.0, 2521.0, 600.0]
    dampings = np.array([5.0, 6.0, 9.0, 9.0, 9.0, 1900.0, 250.0])
    order = np.argsort(hertz)
    clip = sound(sorted(hertz), [1.0] * len(hertz))
    clip = replace(clip, dampings=dampings[order], residual=np.zeros(RATE // 4))
    targets = share_frequencies(["one"], [clip], "auto")
    assert len(targets.frequencies) == 2
    assert 1401.0 < targets.frequencies[0] < 1402.0 and 2043.0 <= targets.frequencies[1] <= 2049.0


def test_a_partial_in_place_of_several_has_their_energy():
    clip = sound([1000.0, 1004.0, 1011.0], [1.0, 0.8, 0.5], damping=12.0)
    clip = replace(clip, phases=np.array([0.3, 1.1, -2.0]), residual=np.zeros(4 * RATE))
    one = heard_partials(clip)
    energies = [float(each.modal_part() @ each.modal_part()) for each in (clip, one)]
    assert len(one.frequencies) == 1 and energies[1] == pytest.approx(energies[0], rel=1e-2)


def test_bursts_are_in_the_rest_and_loudness_does_not_depend_on_the_level():
    clip = sound([500.0, 2500.0], [1.0, 1.0])
    clip = replace(clip, dampings=np.array([8.0, 2000.0]), residual=np.zeros(RATE))
    heard = heard_partials(clip)
    np.testing.assert_allclose(
        heard.modal_part() + heard.residual, clip.modal_part() + clip.residual, atol=1e-12
    )
    quiet = heard_partials(replace(clip, amplitudes=1e-3 * clip.amplitudes))
    np.testing.assert_array_equal(quiet.frequencies, heard.frequencies)


def test_a_design_takes_partials_of_a_rich_clip_that_the_ear_tells_apart():
    rich = sound([100.0 * n for n in range(1, 41)], [1.0 / n for n in range(1, 41)])
    targets = share_frequencies(["rich"], [rich], "auto")
    assert 15 < len(targets.frequencies) <= MOST_MODES
    assert (np.diff(erb_number(targets.frequencies)) >= audibility.RESOLVED).all()
    np.testing.assert_allclose(targets.frequencies[:8], rich.frequencies[:8])
    assert targets.shares.sum() == pytest.approx(1.0)


def test_a_clip_of_one_partial_is_a_design():
    beating = sound([1000.0, 1001.0], [1.0, 1.0])
    assert len(share_frequencies(["one"], [beating], "auto").frequencies) == 1


@pytest.fixture(scope="module")
def clips(tmp_path_factory):
    """Two clips with a mode in common."""
    folder = tmp_path_factory.mktemp("clips")
    for name, frequencies in {"a": [300.0, 800.0], "b": [300.0, 1900.0]}.items():
        part = replace(sound(frequencies, [0.2, 0.1]), residual=np.zeros(RATE // 2))
        write_wav(folder / f"{name}.wav", part.modal_part(), RATE)
    return folder


def test_extract_command_prints_a_table_and_writes_json(clips, tmp_path, capsys):
    paths = [str(clips / "a.wav"), str(clips / "b.wav")]
    out = tmp_path / "targets.json"
    assert main(["extract", *paths, "--out", str(out)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"{paths[0]}: strike at 0.0")
    assert lines[2].split() == ["Hz", "1/s", *"60 dB in s".split(), "a", "b"]
    assert [float(line.split()[0]) for line in lines[3:]] == [300.0, 800.0, 1900.0]
    content = json.loads(out.read_text())
    assert content["names"] == ["a", "b"]
    assert np.round(content["clips"][1]["heard_hz"]).tolist() == [300.0, 1900.0]
    assert "2 partials are heard and count for a design: 300, 800 Hz" in lines[0]
    np.testing.assert_allclose(content["dampings_per_second"], 5.0, rtol=1e-3)
    np.testing.assert_allclose(content["amplitudes"], [[0.2, 0.1, 0], [0.2, 0, 0.1]], rtol=1e-3)


def test_extract_command_writes_what_is_left(clips, tmp_path, capsys):
    left = tmp_path / "left.wav"
    samples, rate = read_wav(clips / "a.wav")
    noise = 1e-3 * np.random.default_rng(0).standard_normal(len(samples))
    write_wav(tmp_path / "noisy.wav", samples + noise, rate)
    arguments = ["extract", str(tmp_path / "noisy.wav"), "--modes", "2", "--json"]
    assert main([*arguments, "--residual", str(left)]) == 0
    assert json.loads(capsys.readouterr().out)["clips"][0]["order"] == 2
    rest = read_wav(left)[0]
    np.testing.assert_allclose(rest, noise[-len(rest) :], atol=2e-4)


def test_extract_command_says_where_most_is_no_mode(clips, tmp_path, capsys):
    samples, rate = read_wav(clips / "a.wav")
    noise = 0.1 * np.random.default_rng(0).standard_normal(len(samples))
    write_wav(tmp_path / "noisy.wav", samples + noise, rate)
    assert main(["extract", str(clips / "a.wav"), "--modes", "2"]) == 0
    assert "noise" not in capsys.readouterr().out
    assert main(["extract", str(tmp_path / "noisy.wav")]) == 0
    assert "of its energy is noise" in capsys.readouterr().out


def test_extract_command_names_the_bad_clip(clips, tmp_path, refuses):
    path = tmp_path / "noise.wav"
    write_wav(path, np.random.default_rng(0).uniform(-0.5, 0.5, 4000), RATE)
    said = refuses(main, "extract", clips / "a.wav", path)
    assert said.startswith(f"sound extract: {path}: the clip has") and "no modes" in said
    twice = [clips / "a.wav"] * 2
    said = refuses(main, "extract", *twice, "--residual", tmp_path / "r.wav")
    assert "of one clip, 2 were given" in said
