"""Narrow bands of a clip, shifted to frequency 0 at a low sampling rate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array, Complex

_STOP_DECIBELS = 80.0
"""Attenuation of the filter outside of a band [dB]."""


@dataclass(frozen=True)
class Band:
    """A part of a clip's spectrum.

    Attributes
    ----------
    centre, width : float [Hz]
        Centre and width of the band; its sinusoids lie within half a width of the centre.
    rate : float [Hz]
        Sampling rate, at least twice the width.
    signal : (n,) complex
        Samples, shifted by the centre to frequency 0.
    """

    centre: float
    width: float
    rate: float
    signal: Complex


def bands(clip: Array, rate: int, width: float, samples: int) -> Iterator[Band]:
    """Bands of `width` [Hz] side by side from 0 to half the rate, `samples` long at most.

    The filter looks ahead: sample n of a band is a weighted sum of later samples of the clip, so a
    damped sinusoid stays one from the strike on, with another coefficient.  The end of the band,
    where the filter would look beyond the clip, is left out.
    """
    from scipy.fft import next_fast_len  # Slow to load.

    factor = max(1, int(rate / (2.0 * width)))
    taps = low_pass(rate, width)
    length = next_fast_len(-(-(len(clip) + len(taps)) // factor))
    spectrum = np.fft.fft(clip, factor * length)
    offsets = np.arange(length) - length // 2
    response = np.fft.fft(taps, factor * length).conj()[offsets] / factor
    kept = min(samples, max(0, len(clip) - len(taps)) // factor + 1)
    step = width * factor * length / rate
    for number in range(int(0.5 * rate / width) + 1):
        centre = round(number * step)
        part = spectrum[(centre + offsets) % (factor * length)] * response
        signal = np.fft.ifft(np.fft.ifftshift(part))[:kept]
        yield Band(centre * rate / (factor * length), width, rate / factor, signal)


def low_pass(rate: int, width: float) -> Array:
    """Taps of a filter that passes up to half the width and stops from one and a half widths on."""
    from scipy.signal import firwin, kaiserord  # Slow to load.

    if 2.0 * width >= 0.99 * rate:
        return np.ones(1)
    count, beta = kaiserord(_STOP_DECIBELS, min(0.99, 2.0 * width / rate))
    return np.asarray(firwin(count, width, window=("kaiser", beta), fs=rate))
