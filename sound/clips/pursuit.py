"""Sinusoids that stand out of a rest: peaks of its spectra under decaying windows."""

from __future__ import annotations

import numpy as np

from carillon.arrays import Array, Complex
from sound.clips.candidates import HIGHEST_FRACTION, LEAST_QUALITY, LOWEST_HERTZ
from sound.clips.significance import NEIGHBOURHOOD, power_under, threshold

APART = 4.0
"""Least distance of two new sinusoids, over the decay of the quicker one."""
MOST = 40
"""Greatest number of sinusoids that are added at a time."""


def further(rest: Array, rate: int) -> Complex:
    """Exponents (k,) per sample of damped sinusoids that stand out of a rest, strongest first.

    Under a window exp(-d n), a sinusoid of the decay d has the greatest power over that of the
    noise, which is the median around it.
    """
    decay, found, scores = 1.0 / len(rest), [], []
    while decay < np.pi / (4.0 * LEAST_QUALITY):
        power, size = power_under(rest, decay, padding=2.0)
        reach = max(16, round(NEIGHBOURHOOD * decay / (2.0 * np.pi) * size))
        level = _medians(power, reach) / np.log(2.0)
        score = 2.0 * power / np.maximum(level, np.finfo(float).tiny)
        peaks = 1 + np.flatnonzero((score[1:-1] >= score[:-2]) & (score[1:-1] > score[2:]))
        omega = 2.0 * np.pi * peaks / size
        rings = omega > 2.0 * LEAST_QUALITY * decay
        inside = (omega > 2.0 * np.pi * LOWEST_HERTZ / rate) & (omega < HIGHEST_FRACTION * np.pi)
        exponents = -decay + 1j * omega
        stands_out = score[peaks] > threshold(exponents, len(rest))
        kept = rings & inside & stands_out
        found.append(exponents[kept])
        scores.append(score[peaks][kept])
        decay *= 2.0
    return _apart(np.concatenate(found), np.concatenate(scores))


def _medians(power: Array, reach: int) -> Array:
    """Median of the power around each frequency, interpolated between medians of intervals."""
    count = max(1, len(power) // reach)
    length = len(power) // count
    middles = length * (np.arange(count) + 0.5)
    medians = np.median(power[: count * length].reshape(count, length), axis=1)
    return np.interp(np.arange(len(power)), middles, medians)


def _apart(exponents: Complex, scores: Array) -> Complex:
    """The strongest exponents, none close to a stronger one."""
    chosen: list[complex] = []
    for number in np.argsort(-scores):
        each = exponents[number]
        if all(abs(each - other) > APART * -min(each.real, other.real) for other in chosen):
            chosen.append(complex(each))
        if len(chosen) == MOST:
            break
    return np.array(chosen, complex)
