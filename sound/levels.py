"""Level of samples: loudness, peak and end, fades, limited peaks, and dither of whole numbers."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array

FULL = 0.99
"""Largest magnitude of a sound that is kept within full scale; rounding does not take it to 1."""
HEARD = 2e-5
"""Threshold of hearing at 1 kHz [Pa], 0 dB of sound pressure (ISO 389)."""
HIGHEST_HEARD = 20_000.0
"""Highest frequency that is heard [Hz]."""
BLOCK_SECONDS = 0.4
"""Length of a gating block of ITU-R BS.1770 [s]."""
LOWEST_METER_RATE = 8_000
"""Least sampling rate [Hz] at which the filter of BS.1770 is itself, within 0.25 dB."""
END_DBFS = -60.0
"""Greatest level [dBFS] at which a sound ends without a fade."""
DECAY_NEPERS = np.log(1e3)
"""Decay by 60 dB [nepers]."""
SILENCE_DBFS = -144.0
"""Level [dBFS] below which an end is told to be silent: less than a step of 24 bits."""
END_SECONDS = 0.1
"""Length of the end whose level is told [s]."""
FADE_SHARE, LONGEST_FADE = 0.1, 0.5
"""Length of a fade over that of the sound, and its greatest length [s]."""
LOOK_SECONDS = 0.005
"""Time before and after a peak in which it is attenuated [s]."""
LIMITED_DECIBELS = 36.0
"""Greatest attenuation of peaks of a sound that stays as loud [dB]."""
LOUDNESS_TOLERANCE, LOUDNESS_ROUNDS = 0.1, 12
"""Greatest difference [LU] of a sound whose peaks are attenuated from what it was, and greatest
number of attempts."""


def decibels(magnitude: float) -> float:
    """Level [dB] of a magnitude over 1; -inf of 0.

    Examples
    --------
    >>> decibels(0.1), decibels(0.0)
    (-20.0, -inf)
    """
    return float(20.0 * np.log10(magnitude)) if magnitude > 0.0 else -np.inf


def loudness_lufs(samples: Array, rate: int) -> float:
    """Integrated loudness [LUFS] of samples (s,) or (s, c) by ITU-R BS.1770-4.

    The rate is in Hz.  A sound shorter than a gating block of 0.4 s is followed by silence up to
    that length.  The loudness of silence, and of what is fainter than -70 LUFS throughout, is -inf.

    Examples
    --------
    >>> tone = np.sin(2.0 * np.pi * 997.0 * np.arange(48_000) / 48_000)
    >>> round(loudness_lufs(tone, 48_000), 2)
    -3.01
    """
    from pyloudnorm import Meter  # Slow to load.

    samples = np.asarray(samples, dtype=float)
    if rate < LOWEST_METER_RATE:
        from scipy.signal import resample_poly

        more = -(-LOWEST_METER_RATE // rate)
        samples, rate = resample_poly(samples, more, 1), more * rate
    missing = max(0, int(np.ceil(BLOCK_SECONDS * rate)) - len(samples))
    padded = np.pad(samples, [(0, missing)] + [(0, 0)] * (samples.ndim - 1))
    # "DeMan" has the coefficients of the standard at 48 kHz, the default filter is off by 0.04 dB.
    return float(Meter(rate, filter_class="DeMan").integrated_loudness(padded))


def relative_loudness(samples: Array, rate: int) -> float:
    """Loudness [LUFS] of samples at any level: as if it had been measured at a peak of full scale.

    A factor on the samples changes it by just as much.  That of silence is -inf.

    Examples
    --------
    >>> faint = 1e-6 * np.sin(2.0 * np.pi * 997.0 * np.arange(48_000) / 48_000)
    >>> round(relative_loudness(faint, 48_000), 2)
    -123.01
    """
    peak = float(np.abs(samples).max(initial=0.0))
    return -np.inf if peak == 0.0 else decibels(peak) + loudness_lufs(samples / peak, rate)


def end_dbfs(samples: Array, rate: int) -> float:
    """Peak level [dBFS] of the last `END_SECONDS` of samples (s,) or (s, c) at a rate [Hz]."""
    last = samples[-max(1, round(END_SECONDS * rate)) :]
    return decibels(float(np.abs(last).max(initial=0.0)))


def faded(samples: Array, rate: int, seconds: float | None = None) -> tuple[Array, float]:
    """Samples (s,) or (s, c) with a fade at the end, and the length of the fade [s].

    The fade is half a cosine over the last `seconds`; the last sample is 0.  If None, it is as long
    as `fade_of_ringing` says, and there is none if the end is not louder than `END_DBFS`.

    Examples
    --------
    >>> samples, seconds = faded(np.ones(40), 10, 0.4)
    >>> samples[-5:].round(2).tolist(), seconds
    ([1.0, 0.85, 0.5, 0.15, 0.0], 0.4)
    """
    if seconds is None:
        if end_dbfs(samples, rate) <= END_DBFS:
            return samples, 0.0
        seconds = fade_of_ringing(len(samples) / rate)
    count = min(len(samples), round(seconds * rate))
    if count == 0:
        return samples, 0.0
    gains = np.ones(len(samples))
    gains[-count:] = 0.5 + 0.5 * np.cos(np.pi * np.arange(1, count + 1) / count)
    return (samples.T * gains).T, count / rate


def fade_of_ringing(seconds: float) -> float:
    """Length [s] of the fade of a sound of some `seconds` that still rings at its end.

    It is a tenth of the sound, `LONGEST_FADE` at most.

    Examples
    --------
    >>> fade_of_ringing(2.0), fade_of_ringing(30.0)
    (0.2, 0.5)
    """
    return min(LONGEST_FADE, FADE_SHARE * seconds)


def limiting_gains(samples: Array, rate: int) -> Array:
    """Gains (s,) that keep samples (s,) or (s, c) at a rate [Hz] within `FULL`.

    They are 1 but within `LOOK_SECONDS` of samples that are beyond, and change smoothly.

    Examples
    --------
    >>> samples = np.where(np.arange(1000) == 500, 2.0, 0.5)
    >>> gains = limiting_gains(samples, 10_000)
    >>> round(float((gains * samples).max()), 9), gains[[0, 399, 601]].tolist()
    (0.99, [1.0, 1.0, 1.0])
    """
    from scipy.ndimage import minimum_filter1d, uniform_filter1d  # Slow to load.

    peaks = np.abs(samples) if samples.ndim == 1 else np.abs(samples).max(axis=1)
    if peaks.max(initial=0.0) <= FULL:
        return np.ones(len(peaks))
    needed = FULL / np.maximum(peaks, FULL)
    # The mean over a window of least values over the same window never exceeds what is needed.
    size = 2 * round(0.25 * LOOK_SECONDS * rate) + 1
    least = minimum_filter1d(needed, 2 * size - 1, mode="nearest")
    smooth = uniform_filter1d(uniform_filter1d(least, size, mode="nearest"), size, mode="nearest")
    # Running sums round.
    return np.where(smooth > 1.0 - 1e-12, 1.0, np.minimum(smooth, needed))


def limited(
    samples: Array, rate: int, seconds: float | None = None, beside: Array | None = None
) -> tuple[float, Array]:
    """A factor, and gains (s,), that keep samples (s,) within `FULL` and as loud as they are.

    Peaks that are attenuated take loudness away, which the factor gives back, as far as
    `LIMITED_DECIBELS` allow.  Loudness is that of the first `seconds`, or of all.  Samples `beside`
    (s,) are kept within `FULL`, too.

    Examples
    --------
    >>> tone = np.exp(-np.arange(8000) / 800) * np.sin(np.arange(8000))
    >>> factor, gains = limited(3.0 * tone, 8000)
    >>> factor > 1.0, round(float(np.abs(factor * gains * 3.0 * tone).max()), 2)
    (True, 0.99)
    """
    held = np.stack([samples, samples if beside is None else beside], axis=1)
    peak = float(np.abs(held).max(initial=0.0))
    if peak <= FULL:
        return 1.0, np.ones(len(samples))
    first = len(samples) if seconds is None else max(1, round(seconds * rate))
    most = FULL * 10.0 ** (LIMITED_DECIBELS / 20.0) / peak
    factor, asked = min(1.0, most), relative_loudness(samples[:first], rate)
    gains = limiting_gains(factor * held, rate)
    for _ in range(LOUDNESS_ROUNDS):
        lost = asked - relative_loudness((factor * gains * samples)[:first], rate)
        if lost <= LOUDNESS_TOLERANCE or factor >= most:
            break
        factor = min(most, factor * 10.0 ** (lost / 20.0))
        gains = limiting_gains(factor * held, rate)
    return factor, gains


def dithered(samples: Array, bits: int, seed: int = 0) -> NDArray[np.int32]:
    """Whole numbers of `bits` bits for samples (s,) or (s, c) of full scale 1, with dither.

    The dither is the sum of two uniform random numbers of a step each, of triangular distribution
    (TPDF), so that the error is noise whose power does not depend on the sound.  Samples that are 0
    stay so: silence is silent.  The same `seed` makes the same numbers.  Samples beyond full scale
    are clipped.

    Examples
    --------
    >>> whole = dithered(np.full(100_000, 0.25 / 32768), 16)
    >>> np.unique(whole).tolist(), round(float(whole.mean()), 1)
    ([-1, 0, 1], 0.2)
    """
    random = np.random.default_rng(seed)
    most = float(1 << (bits - 1))
    noise = random.random(np.shape(samples)) - random.random(np.shape(samples))
    noise[samples == 0.0] = 0.0
    return np.clip(np.rint(most * samples + noise), -most, most - 1.0).astype(np.int32)


@dataclass(frozen=True)
class SoundLevel:
    """Level of a sound that is written."""

    loudness_lufs: float | None
    """LUFS: integrated loudness (ITU-R BS.1770), None of silence."""
    peak_dbfs: float | None
    """dBFS: largest magnitude, None of silence."""
    end_dbfs: float | None
    """dBFS: largest magnitude at the end, before the fade; None of silence there."""
    fade_seconds: float
    """s: length of the fade at the end, 0 for none."""

    @classmethod
    def of(cls, samples: Array, rate: int, end: float, fade_seconds: float = 0.0) -> "SoundLevel":
        """The level of samples (s,) or (s, c) at a rate [Hz] that end at `end` [dBFS], and fade."""
        peak = decibels(float(np.abs(samples).max(initial=0.0)))
        loudness = loudness_lufs(samples, rate)
        return cls(_finite(loudness), _finite(peak), _finite(end), fade_seconds)

    def as_dict(self) -> dict[str, Any]:
        """Plain values by name."""
        return asdict(self)

    def in_words(self) -> str:
        """What it is, as part of a sentence.

        Examples
        --------
        >>> SoundLevel(-18.44, -1.02, -21.3, 0.5).in_words()
        '-18.4 LUFS, peak -1.0 dBFS, ends at -21.3 dBFS with a fade of 0.5 s'
        >>> SoundLevel(-18.44, -1.02, -5008.7, 0.0).in_words()
        '-18.4 LUFS, peak -1.0 dBFS, ends in silence'
        >>> SoundLevel(None, None, None, 0.0).in_words()
        'silent'
        """
        if self.peak_dbfs is None:
            return "silent"
        loudness = "below -70" if self.loudness_lufs is None else f"{self.loudness_lufs:.1f}"
        is_silent = self.end_dbfs is None or self.end_dbfs < SILENCE_DBFS
        end = "in silence" if is_silent else f"at {self.end_dbfs:.1f} dBFS"
        fade = f" with a fade of {self.fade_seconds:.3g} s" if self.fade_seconds else ""
        return f"{loudness} LUFS, peak {self.peak_dbfs:.1f} dBFS, ends {end}{fade}"


def _finite(value: float) -> float | None:
    return value if np.isfinite(value) else None
