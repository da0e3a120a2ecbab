"""Level of a design's modes: a strike of 1 N s at a target's point is as loud as its clip."""

from dataclasses import dataclass
from math import gcd

import numpy as np

from carillon.arrays import Array
from solver.response.response import SAMPLE_RATE_HERTZ
from sound.bounds import LONGEST_COMPARED
from sound.clips.targets import Targets
from sound.levels import BLOCK_SECONDS, relative_loudness
from sound.synthesis.sinusoids import damped_sinusoids

LEAST_SHARE = 0.1
"""Least power of the modes over that of the clip."""
ROUNDS = 3
"""Number of times that the power of the modes is corrected by the loudness that it makes."""


@dataclass(frozen=True)
class ClipLevel:
    """Factors (T,) on amplitudes [kg^1/2 N^-1 s^-1], `gains`, and on the clips' noise, `noise`."""

    gains: Array
    noise: Array


def clip_level(
    targets: Targets, frequencies: Array, dampings: Array, amplitudes: Array
) -> ClipLevel:
    """Level of modes at the points of T targets, so that each is as loud as its clip.

    Loudness is integrated (ITU-R BS.1770) over the length of the clip.  Noise stays as it is in
    the clip, and modes are so loud that both together are as loud as the whole clip, which also has
    tones that are neither; but modes have a tenth of the clip's power at least, and noise gives way
    if it must.

    Parameters
    ----------
    targets
        Modes and noise of the clips, and their loudness.
    frequencies, dampings : (N,) [Hz], [1/s]
        Of the modes that sound.
    amplitudes : (T, N) [kg^-1/2 N s]
        Theirs after 1 N s inwards at the point of each target.
    """
    gains, factors = np.zeros(len(targets.names)), np.ones(len(targets.names))
    for t in range(len(targets.names)):
        count = round(_seconds(targets, t) * SAMPLE_RATE_HERTZ)
        noise = np.zeros(count)
        part = resampled(targets.noises[t][0], targets.rates[t], SAMPLE_RATE_HERTZ)[:count]
        noise[: len(part)] = part
        modes = _samples(frequencies, dampings, amplitudes[t], count)
        gains[t], factors[t] = _level(modes, noise, _clip_loudness(targets, t, count))
    return ClipLevel(gains, factors)


def _level(modes: Array, noise: Array, loudness: float) -> tuple[float, float]:
    """Factors on modes (s,) and on noise (s,) whose sum then has a loudness [LUFS]."""
    own, asked = 10.0 ** (_loudness(modes) / 10.0), 10.0 ** (loudness / 10.0)
    square = asked / own if own > 0.0 else 0.0
    least = LEAST_SHARE * square
    for _ in range(ROUNDS):
        whole = 10.0 ** (_loudness(np.sqrt(square) * modes + noise) / 10.0)
        # What the noise adds to the power of the modes depends on the gates, so on their level.
        square = max(least, square + (asked - whole) / own) if own > 0.0 else 0.0
    whole = _loudness(np.sqrt(square) * modes + noise)
    known = np.isfinite(whole) and np.isfinite(loudness)
    factor = 10.0 ** ((loudness - whole) / 20.0) if known else 1.0
    return float(factor * np.sqrt(square)), float(factor)


def _clip_loudness(targets: Targets, t: int, count: int) -> float:
    """Loudness [LUFS] of a target's clip; that of its modes and its residual if it is unknown."""
    if targets.loudness is not None:
        return float(targets.loudness.lufs[t])
    clip = _samples(targets.frequencies, targets.dampings, targets.amplitudes[t], count)
    rest = resampled(targets.residuals[t], targets.rates[t], SAMPLE_RATE_HERTZ)[:count]
    clip[: len(rest)] += rest
    return _loudness(clip)


def resampled(samples: Array, own: int, rate: int) -> Array:
    """Samples resampled from the rate `own` to `rate`."""
    if own == rate or not len(samples):
        return samples
    from scipy.signal import resample_poly

    common = gcd(own, rate)
    return np.asarray(resample_poly(samples, rate // common, own // common))


def _seconds(targets: Targets, t: int) -> float:
    """Time over which loudness is compared [s]: a clip's length, or that of its residual."""
    if targets.loudness is not None:
        return min(LONGEST_COMPARED, float(targets.loudness.seconds[t]))
    rest = len(targets.residuals[t]) / targets.rates[t]
    return min(LONGEST_COMPARED, max(BLOCK_SECONDS, rest))


def _samples(frequencies: Array, dampings: Array, amplitudes: Array, count: int) -> Array:
    heard = frequencies < SAMPLE_RATE_HERTZ / 2.0
    kept = (frequencies[heard], dampings[heard], amplitudes[heard])
    return damped_sinusoids(*kept, np.zeros(int(heard.sum())), SAMPLE_RATE_HERTZ, count)


def _loudness(samples: Array) -> float:
    return relative_loudness(samples, SAMPLE_RATE_HERTZ)
