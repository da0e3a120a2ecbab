"""Where the sound of a strike begins and ends in a clip, and where a second strike begins.

The sound of a strike decays ever more slowly, since quick modes die away first.  A fade-out of an
editor ends in silence, which no sum of damped sinusoids does.
"""

import numpy as np

from carillon.arrays import Array

_QUIETER = 10.0
"""Least mean power after a strike, over that before it."""

_FRAME_SECONDS, _HOPS = 0.01, 4
"""Length of a short-time spectrum [s], and number of spectra that begin within it."""
_LOWEST_BAND, _HIGHEST_FRACTION = 200.0, 0.9
"""Lowest frequency of the third-octave bands [Hz], and the highest over half the sampling rate."""
_AFTER, _GAP, _BEFORE = 4, 4, 8
"""Numbers of spectra after a strike, at it, and before it."""
_LATER_SECONDS = 0.05
"""Time after the strike [s] in which rises belong to the same blow."""
_RISE, _AUDIBLE = 4.0, 1e-3
"""Least power of a band after a strike, over that before it, and over that of its loudest
spectrum."""
_SHARE = 0.5
"""Least share of bands that rise together at a strike; beats and swells raise fewer."""
_SILENT = 1e-6
"""Greatest magnitude of added silence, over the clip's largest."""
_SHORTEST_FADE, _LONGER = 0.01, 1.3
"""Length of the shortest fade that is looked for [s], and ratio of successive lengths."""
_FALLS = np.array([1.0, 3.0, 9.0])
"""Least falls [dB] of the second, third and fourth quarter of a fade below the level extrapolated
from before it.  A linear fade falls by 4.2, 8.3 and 16.8 dB, one by a cosine by more."""
_PARTS = 8
"""Number of intervals before a fade, each a quarter of it long, that give the expected levels."""


def strike_sample(clip: Array) -> int:
    """Number of the first sample of the strike; 0 if the clip is not quieter before it.

    The sample, at or before the loudest one, that splits the clip up to there best into two
    stretches of white noise of different power (the change point of Maeda 1985).
    """
    loudest = int(np.argmax(np.abs(clip)))
    # As much after the loudest sample as before it, so that both stretches have some length.
    part = clip[: 2 * loudest + 1]
    if loudest < 2 or len(part) < 8:
        return 0
    energy = np.concatenate([[0.0], np.cumsum(part**2)])
    splits = np.arange(1, loudest + 1)
    least = np.finfo(float).eps * energy[-1]
    before = np.maximum(energy[splits], least) / splits
    after = (energy[-1] - energy[splits]) / (len(part) - splits)
    cost = splits * np.log(before) + (len(part) - splits) * np.log(after)
    best = int(np.argmin(cost))
    return int(splits[best]) if after[best] > _QUIETER * before[best] else 0


def second_strike(clip: Array, rate: int) -> int | None:
    """Number of a sample shortly before a second strike, in a clip (s,) that begins with the first.

    A strike is where the power of most bands, of a third of an octave each, rises by 6 dB at once.
    """
    from scipy.signal import stft

    frame = max(16, round(_FRAME_SECONDS * rate))
    hop = frame // _HOPS
    if len(clip) < frame + (_BEFORE + _GAP + _AFTER) * hop:
        return None
    hertz, _, spectra = stft(
        clip, rate, nperseg=frame, noverlap=frame - hop, boundary=None, padded=False
    )
    highest = _HIGHEST_FRACTION * 0.5 * rate
    edges = _LOWEST_BAND * 2.0 ** (np.arange(3.0 * np.log2(highest / _LOWEST_BAND)) / 3.0)
    band = np.digitize(hertz, edges)
    inside = [band == number for number in np.unique(band[(band > 0) & (band < len(edges))])]
    if not inside:
        return None
    power = np.array([(np.abs(spectra[which]) ** 2).sum(axis=0) for which in inside])
    sums = np.pad(power.cumsum(axis=1), ((0, 0), (1, 0)))
    strikes = np.arange(_BEFORE + _GAP, power.shape[1] - _AFTER)
    after = (sums[:, strikes + _AFTER] - sums[:, strikes]) / _AFTER
    early = strikes - _GAP
    before = (sums[:, early] - sums[:, early - _BEFORE]) / _BEFORE
    rises = (after > _RISE * before) & (after > _AUDIBLE * power.max(axis=1, keepdims=True))
    is_strike = (rises.mean(axis=0) > _SHARE) & (strikes * hop > _LATER_SECONDS * rate)
    return int(strikes[is_strike][0]) * hop if is_strike.any() else None


def ending(clip: Array, rate: int) -> int:
    """Number of samples of a clip (s,) before the silence or fade-out at its end."""
    loud = np.flatnonzero(np.abs(clip) > _SILENT * np.abs(clip).max(initial=0.0))
    end = int(loud[-1]) + 1 if len(loud) else len(clip)
    energy = np.concatenate([[0.0], np.cumsum(clip[:end] ** 2)])
    quarter = float(max(2, round(0.25 * _SHORTEST_FADE * rate)))
    faded = 0
    while (_PARTS + 4) * int(quarter) <= end:
        if _fades(energy, int(quarter)):
            faded = 4 * int(quarter)
        quarter *= _LONGER
    return end - faded


def _fades(energy: Array, quarter: int) -> bool:
    """Whether the last four intervals of `quarter` samples are a fade-out."""
    ends = len(energy) - 1 - quarter * np.arange(_PARTS + 4, -1, -1)
    powers = np.diff(energy[ends])
    levels = 10.0 * np.log10(np.maximum(powers, 1e-300))
    slope, level = np.polyfit(np.arange(-_PARTS, 0), levels[:_PARTS], 1)
    # A level that rises before is expected to stay.
    expected = level + min(slope, 0.0) * np.arange(4)
    return bool((expected[1:] - levels[-3:] >= _FALLS).all())
