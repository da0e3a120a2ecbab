"""Candidates for the modes of a clip: damped sinusoids that ESPRIT finds in its bands."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Complex
from carillon.command_line.progress import track
from sound.clips.bands import Band, bands
from sound.clips.esprit import esprit

BAND_SAMPLES = 512
"""Greatest number of samples of a band, from the strike on; those of a narrow band last longer."""
BAND_DECAY = 5.0
"""Decay within a band's length [nepers] above which a mode is sought again in wider bands."""
LOWEST_HERTZ, HIGHEST_FRACTION = 20.0, 0.97
"""Lowest frequency of a mode [Hz], and the highest over half the sampling rate."""
LEAST_QUALITY = 2.0
"""Least quality factor pi f / d of a mode; a quicker decay makes a knock."""
LEAST_DECAY = 0.1
"""Least decay of a mode within the clip [nepers] (0.87 dB); a slower decay makes a steady tone."""
_MOST_GROWTH = 5.0
"""Greatest growth of a sinusoid within the clip [nepers]; growing ones show that a clip does not
decay."""
_LATER = 16
"""Delay of the second search in a band [samples]."""
MOST = 200
"""Greatest number of candidates of one pass over the bands."""
_PEAK = 20.0
"""Largest over median power of a band's spectrum below which the band counts as noise."""


def candidates(rest: Array, rate: int, width: float, label: str, visible: bool) -> Complex:
    """Exponents (k,) per sample of the sinusoids in all bands of `width` [Hz] of a rest.

    The `MOST` of greatest energy are kept.  Otherwise a clip that ends in mid-tone, without noise,
    would take minutes, as its end leaves traces in all bands.
    """
    count = int(0.5 * rate / width) + 1
    parts = track(bands(rest, rate, width, BAND_SAMPLES), label, count, visible=visible)
    most = _MOST_GROWTH / len(rest)
    of_bands = [_band_exponents(band, rate, most) for band in parts]
    exponents = np.concatenate([each for each, _ in of_bands])
    energies = np.concatenate([energies for _, energies in of_bands])
    return exponents[np.sort(np.argsort(-energies, kind="stable")[:MOST])]


def _band_exponents(band: Band, rate: int, growth: float) -> tuple[Complex, Array]:
    """Exponents (k,) per sample of the clip, and the energy (k,) that each has in the band.

    None grows by more than `growth` nepers a sample.
    """
    nothing = np.zeros(0, complex), np.zeros(0)
    power = np.abs(np.fft.fft(band.signal)) ** 2
    if len(power) < 4 * _LATER or power.max() < _PEAK * np.median(power):
        return nothing
    own = _stable(band.signal)
    energies = _energies(own, band.signal)
    exponents = own * band.rate / rate
    inside = np.abs(exponents.imag) * rate <= np.pi * band.width
    exponents = exponents[inside] + 2j * np.pi * band.centre / rate
    low, high = 2.0 * np.pi * LOWEST_HERTZ / rate, HIGHEST_FRACTION * np.pi
    sounds = (exponents.imag > low) & (exponents.imag < high) & rings(exponents)
    kept = sounds & (exponents.real <= growth)
    return exponents[kept], energies[inside][kept]


def _energies(exponents: Complex, signal: Complex) -> Array:
    """Energy (k,) of each sinusoid within the signal, fitted to it together."""
    if not len(exponents):
        return np.zeros(0)
    waves = np.exp(np.outer(np.arange(len(signal)), exponents))
    coefficients = np.linalg.lstsq(waves, signal, rcond=None)[0]
    return np.asarray((np.abs(waves * coefficients) ** 2).sum(axis=0))


def rings(exponents: Complex) -> NDArray[np.bool_]:
    """Which sinusoids have at least the quality factor `LEAST_QUALITY`."""
    return exponents.imag > -2.0 * LEAST_QUALITY * exponents.real


def _stable(signal: Complex) -> Complex:
    """Exponents per sample that ESPRIT finds from the strike on and also from a little later on.

    The exponents of a blow's noise change altogether, while that of a mode moves by less than its
    decay, or by less than the resolution of so short a signal.
    """
    exponents, later = esprit(signal), esprit(signal[_LATER:])
    moved = np.abs(exponents[:, None] - later).min(axis=1)
    return exponents[moved < np.maximum(-exponents.real, BAND_DECAY / len(signal))]
