"""How far apart two sounds are: the rms difference of their levels in bands, over time."""

import numpy as np

from carillon.arrays import Array
from solver.response.response import spectrogram

CENTRES = 1e3 * 10.0 ** (np.arange(-10, 13) / 10.0)
"""Centres of third-octave bands from 100 Hz to 16 kHz [Hz]."""
FLOOR_DECIBELS = -60.0
"""Level below the loudest of the target at which silence begins."""


def log_spectral_distance(sound: Array, target: Array, rate: int) -> float:
    """Rms difference [dB] of the levels of two sounds in third-octave bands.

    Levels are those of the power within a window of 23 ms, every 4 ms, for as long as the target
    lasts.  What is below `FLOOR_DECIBELS` counts as just there; where both sounds are, nothing is
    compared.  A gain common to both sounds changes nothing, a gain of one does.

    Raises ValueError if the target is silent.

    Parameters
    ----------
    sound, target : (s,), (t,)
        Samples; silence follows a sound that is shorter than its target.
    rate : int [Hz]
        Samples per second of both.
    """
    reference = _band_powers(target, rate)
    loudest = float(reference.max(initial=0.0))
    if loudest == 0.0:
        raise ValueError("the target is silent, expected a sound")
    cut = np.pad(sound[: len(target)], (0, max(0, len(target) - len(sound))))
    levels = [_levels(powers / loudest) for powers in (_band_powers(cut, rate), reference)]
    heard = np.maximum(*levels) > FLOOR_DECIBELS
    return float(np.sqrt(np.mean((levels[0] - levels[1])[heard] ** 2)))


def _levels(powers: Array) -> Array:
    return np.asarray(10.0 * np.log10(np.maximum(powers, 10.0 ** (FLOOR_DECIBELS / 10.0))))


def _band_powers(sound: Array, rate: int) -> Array:
    """Powers (b, t) in the bands that the rate has, over time."""
    _, hertz, magnitudes = spectrogram(sound, rate)
    edges = np.append(CENTRES, CENTRES[-1] * 10.0**0.1) / 10.0**0.05
    edges = edges[edges <= rate / 2.0]
    bins = np.searchsorted(hertz, edges)
    powers = [(magnitudes[low:high] ** 2).sum(axis=0) for low, high in zip(bins, bins[1:])]
    return np.array(powers)
