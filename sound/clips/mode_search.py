"""Search for the damped sinusoids of a clip, and for the modes among them.

The clip is split into bands.  ESPRIT (Roy and Kailath 1989) finds the damped sinusoids of every
band, ESTER (Badeau, David and Richard 2006) their number, and a least-squares fit to the whole clip
refines them.  Narrow bands come first: they separate slow and close modes.  Wide bands then find
quickly decaying modes in the rest.  Sinusoids that still stand out of the rest, as peaks of its
spectra under decaying windows, are added; those that do not stand out of the noise are dropped, so
that ESTER may find too many.
"""

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Complex
from sound.clips.candidates import (
    BAND_DECAY,
    BAND_SAMPLES,
    HIGHEST_FRACTION,
    LEAST_DECAY,
    LEAST_QUALITY,
    LOWEST_HERTZ,
    candidates,
    rings,
)
from sound.clips.significance import NEIGHBOURHOOD, Fit, power_under, settled, threshold
from sound.synthesis.sinusoids import superposed

FEWEST_PERIODS = 3.0
"""Least number of periods of a mode within the clip; a slower oscillation counts as drift."""
PURSUITS = 6
"""Greatest number of rounds in which sinusoids that stand out of the rest are added."""
WIDTH_FACTORS = (1.0, 4.0, 16.0)
"""Widths of the bands, one search after the other, over the width of the narrowest."""
SETTLING_STEPS, _FINAL_STEPS = 4, 20
"""Numbers of least-squares steps after each change of the set of sinusoids, and at the end."""
SAME = 0.25
"""Distance of two exponents, over the decay of one, below which they count as one mode."""
UNDER_PEAK, DROWNED = 2.0, 0.01
"""Distance from a louder sinusoid, over that one's decay, and share of its amplitude, below which a
sinusoid only corrects the fit of the louder one and is dropped."""
APART = 4.0
"""Least distance of two new sinusoids, over the decay of the quicker one."""
MOST = 40
"""Greatest number of sinusoids that are added at a time."""


def sinusoids(clip: Array, rate: int, visible: bool = False) -> Fit:
    """All damped sinusoids that stand out of a clip of peak 1."""
    fit = settled(np.zeros(0, complex), clip, 0)
    first = 0.5 * BAND_SAMPLES / min(1.0, len(clip) / rate)
    widths = [first * factor for factor in WIDTH_FACTORS]
    for width in [width for width in widths if width < 0.5 * rate] or [0.5 * rate]:
        is_slow = -fit.exponents.real * rate < BAND_DECAY * 2.0 * width / BAND_SAMPLES
        slow, quick = fit.chosen(is_slow), fit.exponents[~is_slow]
        rest = clip - superposed(slow.exponents, slow.coefficients, len(clip))
        new = candidates(rest, rate, width, f"bands of {width:.0f} Hz", visible)
        # Otherwise two sinusoids would be fitted to one mode, which fits a clean clip even better.
        new = new[~_is_beside(new, slow.exponents)]
        quick = quick[~_is_beside(quick, new)]
        fit = settled(np.concatenate([slow.exponents, quick, new]), clip, SETTLING_STEPS)
    return pursued(fit, clip, rate)


def pursued(fit: Fit, clip: Array, rate: int) -> Fit:
    """A fit completed by the sinusoids that stand out of its rest, and refined to the end."""
    for _ in range(PURSUITS):
        rest = clip - superposed(fit.exponents, fit.coefficients, len(clip))
        new = further(rest, rate)
        new = new[~_is_beside(new, fit.exponents)]
        if not len(new):
            break
        before = len(fit.exponents)
        fit = settled(np.concatenate([fit.exponents, new]), clip, SETTLING_STEPS)
        if len(fit.exponents) <= before:
            break
    fit = settled(fit.exponents, clip, _FINAL_STEPS)
    return settled(fit.exponents[~_is_drowned(fit)], clip, 0)


def _is_beside(exponents: Complex, others: Complex) -> NDArray[np.bool_]:
    if not len(others):
        return np.zeros(len(exponents), bool)
    distance = np.abs(exponents[:, None] - others).min(axis=1)
    return np.asarray(distance < SAME * np.abs(exponents.real))


def _is_drowned(fit: Fit) -> NDArray[np.bool_]:
    """Which sinusoids lie under the peak of a far louder one."""
    distance = np.abs(fit.exponents[:, None] - fit.exponents)
    under = distance < UNDER_PEAK * np.abs(fit.exponents.real)
    amplitudes = np.abs(fit.coefficients)
    louder = amplitudes[None, :] * DROWNED > amplitudes[:, None]
    return np.asarray((under & louder).any(axis=1))


def is_mode(fit: Fit, samples: int) -> NDArray[np.bool_]:
    """Which sinusoids decay and sound for several periods within the clip."""
    decays = -fit.exponents.real * samples > LEAST_DECAY
    return decays & rings(fit.exponents) & has_periods(fit, samples)


def modes_of(fit: Fit, clip: Array) -> Fit:
    """The modes of a fit, fitted again without the sinusoids that are no modes."""
    kept = is_mode(fit, len(clip))
    if kept.all():
        return fit
    fit = settled(fit.exponents[kept], clip, SETTLING_STEPS)
    return fit.chosen(is_mode(fit, len(clip)))


def has_periods(fit: Fit, samples: int) -> NDArray[np.bool_]:
    """Which sinusoids have enough periods within the clip."""
    return fit.exponents.imag * samples > 2.0 * np.pi * FEWEST_PERIODS


def further(rest: Array, rate: int) -> Complex:
    """Exponents (k,) per sample of damped sinusoids that stand out of a rest, strongest first.

    Under a window exp(-d n), a sinusoid of the decay d has the greatest power over that of the
    noise, which is the median around it.
    """
    decay, outstanding, scores = 1.0 / len(rest), [], []
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
        outstanding.append(exponents[kept])
        scores.append(score[peaks][kept])
        decay *= 2.0
    return _apart(np.concatenate(outstanding), np.concatenate(scores))


def _medians(power: Array, reach: int) -> Array:
    """Median of the power around each frequency, interpolated between medians of intervals."""
    count = max(1, len(power) // reach)
    length = len(power) // count
    middles = length * (np.arange(count) + 0.5)
    medians = np.median(power[: count * length].reshape(count, length), axis=1)
    return np.interp(np.arange(len(power)), middles, medians)


def _apart(exponents: Complex, scores: Array) -> Complex:
    chosen: list[complex] = []
    for number in np.argsort(-scores):
        each = exponents[number]
        if all(abs(each - other) > APART * -min(each.real, other.real) for other in chosen):
            chosen.append(complex(each))
        if len(chosen) == MOST:
            break
    return np.array(chosen, complex)
