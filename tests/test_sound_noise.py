"""What of a clip's rest is noise, and what are tones that no mode has."""

import numpy as np
import pytest
from scipy.signal import lfilter

from sound.clips.extraction import extract
from sound.clips.noise import noise_part
from sound.synthesis.sinusoids import damped_sinusoids

RATE = 44_100
COUNT = 2 * RATE
OCTAVES = 62.5 * 2.0 ** np.arange(8)
FREQUENCIES, DAMPINGS = np.array([400.0, 910.0, 2300.0]), np.array([6.0, 12.0, 30.0])
AMPLITUDES = np.array([0.3, 0.5, 0.2])


def hiss(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=COUNT)


def decaying(samples: np.ndarray, rate: float) -> np.ndarray:
    return samples * np.exp(-rate * np.arange(len(samples)) / RATE)


def partials(*numbers: int) -> np.ndarray:
    chosen = list(numbers)
    values = (FREQUENCIES[chosen], DAMPINGS[chosen], AMPLITUDES[chosen])
    return damped_sinusoids(*values, np.zeros(len(chosen)), RATE, COUNT)


def power(samples: np.ndarray, low: float, high: float) -> float:
    hertz = np.fft.rfftfreq(len(samples), 1.0 / RATE)
    inside = (low <= hertz) & (hertz < high)
    return float((np.abs(np.fft.rfft(samples)[inside]) ** 2).sum())


def decibels(ratio: float) -> float:
    return float(10.0 * np.log10(ratio))


def assert_alike(noise: np.ndarray, expected: np.ndarray, octaves: np.ndarray = OCTAVES) -> None:
    """To a decibel in every octave."""
    for low in octaves:
        assert abs(decibels(power(noise, low, 2 * low) / power(expected, low, 2 * low))) < 1.0


@pytest.mark.parametrize("left_out", range(3))
@pytest.mark.parametrize("level", [0.0, 1e-3, 1e-2])
def test_a_partial_that_was_left_out_is_no_noise(left_out, level):
    rest = partials(left_out) + decaying(level * hiss(), 5.0)
    noise, share = noise_part(rest, RATE)
    near = FREQUENCIES[left_out] + np.array([-1.0, 1.0]) * DAMPINGS[left_out]
    assert decibels(power(noise, *near) / power(rest, *near)) < -15.0
    assert share > 0.9
    assert share == pytest.approx(1.0 - (noise @ noise) / (rest @ rest))


@pytest.mark.parametrize("samples", [hiss(), decaying(hiss(), 8.0)], ids=["steady", "decaying"])
def test_white_noise_stays_as_it_is(samples):
    noise, share = noise_part(samples, RATE)
    assert_alike(noise, samples)
    assert share < 0.1


def test_coloured_noise_stays_as_it_is():
    samples = lfilter([1.0], [1.0, -0.95], hiss())
    noise, _ = noise_part(samples, RATE)
    assert_alike(noise, samples)


def test_a_clip_of_modes_and_noise_keeps_its_noise():
    own = decaying(0.02 * hiss(), 3.0)
    noise, share = noise_part(extract(partials(0, 1, 2) + own, RATE).residual, RATE)
    assert_alike(noise, own)
    assert share < 0.1


def test_noise_beside_a_partial_stays():
    own = decaying(0.02 * hiss(), 3.0)
    noise, _ = noise_part(own + partials(0), RATE)
    assert_alike(noise, own, OCTAVES[OCTAVES >= 1000.0])


def test_a_click_stays_and_nothing_sounds_before_it():
    begin, length = 2000, 200
    rest = np.zeros(COUNT)
    rest[begin : begin + length] = hiss()[:length]
    noise, share = noise_part(rest, RATE)
    assert decibels((noise @ noise) / (rest @ rest)) == pytest.approx(0.0, abs=0.1)
    rest[begin:] += partials(0, 1)[:-begin]
    noise, share = noise_part(rest, RATE)
    assert share > 0.3
    before = noise[: begin - RATE // 500]
    assert before @ before < 1e-6 * (rest @ rest)
    struck = slice(begin, begin + length)
    assert abs(decibels((noise[struck] @ noise[struck]) / (rest[struck] @ rest[struck]))) < 3.0


@pytest.mark.parametrize("count", [0, 1, 300])
def test_short_rests_and_silence_come_back(count):
    noise, share = noise_part(hiss()[:count], RATE)
    assert len(noise) == count and 0.0 <= share < 0.2
    assert noise_part(np.zeros(count), RATE)[1] == 0.0
