"""Gain with which the strikes of a modal model stay within full scale."""

import numpy as np

from carillon.arrays import Array
from sound.levels import FULL

RATES = (44_100, 48_000, 96_000)
"""Sampling rates [Hz] of programs that play a model; peaks differ a little between them."""
SECONDS = 0.5
"""Time after the strike [s] in which its peak is looked for; modes begin in phase."""
_BLOCK = 512
"""Number of samples that are computed at once."""


def gain_within(frequencies: Array, dampings: Array, amplitudes: Array) -> float:
    """Factor, 1 at most, with which an impulse of 1 N s at any of p points has a peak of `FULL`.

    Modes have frequencies (k,) [Hz], dampings (k,) [1/s], and amplitudes (p, k) [1/(N s)].
    """
    peak = max(loudest_peak(frequencies, dampings, amplitudes, rate) for rate in RATES)
    return min(1.0, FULL / peak) if peak > 0.0 else 1.0


def loudest_peak(frequencies: Array, dampings: Array, amplitudes: Array, rate: int) -> float:
    """Largest magnitude after an impulse of 1 N s at any point, at a rate [Hz]."""
    audible = frequencies < rate / 2
    exponents = (-dampings + 2j * np.pi * frequencies)[audible] / rate
    amplitudes = amplitudes[:, audible]
    steps = np.exp(exponents[:, None] * np.arange(_BLOCK))
    peak = 0.0
    for start in range(0, round(SECONDS * rate), _BLOCK):
        begun = np.exp(exponents * start)
        # Only points whose modes would add up to more are computed further.
        amplitudes = amplitudes[_reach(amplitudes, begun) > peak]
        if not len(amplitudes):
            break
        samples = amplitudes @ (steps * begun[:, None]).imag
        peak = max(peak, float(np.abs(samples).max(initial=0.0)))
    return peak


def _reach(amplitudes: Array, begun: Array) -> Array:
    """Bounds (p,) on the magnitudes from a time on, at which modes have the values `begun` (k,)."""
    return np.asarray(np.abs(amplitudes) @ np.abs(begun))
