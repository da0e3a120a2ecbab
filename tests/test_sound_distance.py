"""The distance of two sounds in dB: laws that hold for any sounds."""

import numpy as np
import pytest

from sound.synthesis.sinusoids import damped_sinusoids
from sound.synthesis.spectral_distance import FLOOR_DECIBELS, log_spectral_distance

RATES = (16_000, 44_100, 48_000)


def strike(rate: int, frequencies: tuple[float, ...] = (310.0, 1433.0, 5200.0)) -> np.ndarray:
    """Half a second of a few modes of one level."""
    hertz, ones = np.array(frequencies), np.ones(len(frequencies))
    return damped_sinusoids(hertz, 12.0 * ones, 0.2 * ones, 0.0 * ones, rate, rate // 2)


@pytest.mark.parametrize("rate", RATES)
def test_a_sound_is_no_distance_from_itself_and_silence_is_far(rate):
    sound = strike(rate)
    assert log_spectral_distance(sound, sound, rate) == 0.0
    silence = log_spectral_distance(np.zeros(1), sound, rate)
    assert 10.0 < silence <= -FLOOR_DECIBELS
    assert silence > log_spectral_distance(strike(rate, (320.0, 1433.0, 5200.0)), sound, rate)


def test_a_gain_of_both_changes_nothing_and_a_gain_of_one_is_the_distance():
    one, other = strike(44_100), strike(44_100, (500.0, 3000.0))
    apart = log_spectral_distance(one, other, 44_100)
    assert log_spectral_distance(100.0 * one, 100.0 * other, 44_100) == pytest.approx(apart)
    # Where it falls below the floor less than the gain is left.
    assert 5.0 < log_spectral_distance(0.5 * one, one, 44_100) < 6.03


def test_modes_farther_from_those_of_the_target_are_farther():
    target = strike(44_100, (1000.0, 4000.0))
    steps = [
        log_spectral_distance(strike(44_100, (1000.0 * by, 4000.0)), target, 44_100)
        for by in (1.0, 1.3, 2.5)
    ]
    assert steps == sorted(steps) and steps[0] == 0.0 < steps[1] < steps[2]


def test_phases_count_little_and_what_comes_after_the_target_does_not():
    rate = 44_100
    hertz, ones = np.array([310.0, 1433.0, 5200.0]), np.ones(3)
    turned = damped_sinusoids(hertz, 12.0 * ones, 0.2 * ones, 1.5 * ones, rate, rate // 2)
    target = strike(rate)
    silence = log_spectral_distance(np.zeros(1), target, rate)
    assert log_spectral_distance(turned, target, rate) < 0.2 * silence
    longer = np.concatenate([target, np.ones(1000)])
    assert log_spectral_distance(longer, target, rate) == 0.0


def test_a_silent_target_is_refused():
    with pytest.raises(ValueError, match="silent"):
        log_spectral_distance(strike(44_100), np.zeros(1000), 44_100)
