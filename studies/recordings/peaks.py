"""Peaks of a clip's spectrum that anybody sees, and which of them no mode accounts for."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.signal import find_peaks

from carillon.arrays import Array, Flags

LOWEST_HERTZ, HIGHEST_SHARE = 40.0, 0.45
"""Lowest frequency of peaks [Hz], and the highest as a share of the sampling rate."""
SPAN_DECIBELS = 40.0
"""Level below the loudest peak down to which peaks count [dB]."""
ABOVE_MEDIAN, MEDIAN_HERTZ = 15.0, 200.0
"""Height of a peak above the median [dB], and the reach of that median to either side [Hz]."""
PROMINENCE = 12.0
"""Depth [dB] of the valleys beside it."""
SAME_CENTS, SAME_BINS = 20.0, 0.5
"""Distance of a mode from a peak below which it accounts for it: in cents, or in widths of the
lines that the length of the clip allows."""
_PADDING = 4
_FLOOR = 1e-30
_MEDIAN_STEPS = 50


@dataclass(frozen=True)
class Peaks:
    """Strong peaks of a spectrum."""

    hertz: Array
    """(n,) [Hz]: ascending."""
    decibels: Array
    """(n,) [dB]: levels below that of the loudest."""
    resolution: float
    """float [Hz]: one over the length of the clip."""

    def missed(self, frequencies: Array) -> Flags:
        """Which peaks (n,) none of the `frequencies` (m,) [Hz] accounts for."""
        if not len(frequencies):
            return np.ones(len(self.hertz), bool)
        cents = 1200.0 * np.abs(np.log2(frequencies / self.hertz[:, None])).min(axis=1)
        apart = np.abs(frequencies - self.hertz[:, None]).min(axis=1)
        return np.asarray((cents >= SAME_CENTS) & (apart >= SAME_BINS * self.resolution))


def spectrum(samples: Array, rate: int) -> tuple[Array, Array]:
    """Frequencies (f,) [Hz] and magnitudes (f,) [dB] of a sound that begins with a strike.

    The window is half a Hann window, which fades the end out and leaves the strike as it is.
    """
    count = len(samples)
    window = 0.5 + 0.5 * np.cos(np.pi * np.arange(count) / count)
    size = 1 << int(np.ceil(np.log2(_PADDING * count)))
    magnitudes = np.abs(np.fft.rfft(samples * window, size))
    return np.fft.rfftfreq(size, 1.0 / rate), 20.0 * np.log10(magnitudes + _FLOOR)


def strong_peaks(samples: Array, rate: int) -> Peaks:
    """Strong peaks of a sound (s,) that begins with a strike.

    Examples
    --------
    >>> t = np.arange(8000) / 8000
    >>> strong_peaks(np.exp(-5 * t) * np.sin(2 * np.pi * 440 * t), 8000).hertz.round().tolist()
    [440.0]
    """
    hertz, levels = spectrum(samples, rate)
    seen = (hertz >= LOWEST_HERTZ) & (hertz <= HIGHEST_SHARE * rate)
    hertz, levels = hertz[seen], levels[seen]
    resolution = rate / len(samples)
    if not len(hertz):
        return Peaks(np.zeros(0), np.zeros(0), resolution)
    step = hertz[1] - hertz[0] if len(hertz) > 1 else resolution
    peaks, _ = find_peaks(
        levels,
        height=levels.max() - SPAN_DECIBELS,
        prominence=PROMINENCE,
        distance=max(1, int(1.5 * resolution / step)),
    )
    peaks = peaks[levels[peaks] > _local_median(levels, MEDIAN_HERTZ / step)[peaks] + ABOVE_MEDIAN]
    return Peaks(hertz[peaks], levels[peaks] - levels.max(), resolution)


def _local_median(levels: Array, reach: float) -> Array:
    """The median of the levels up to `reach` lines away, from some of them where there are many."""
    step = max(1, int(reach) // _MEDIAN_STEPS)
    some = median_filter(levels[::step], 2 * int(reach) // step + 1, mode="nearest")
    return np.asarray(np.interp(np.arange(len(levels)), np.arange(0, len(levels), step), some))
