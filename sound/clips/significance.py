"""Significance of damped sinusoids in a clip's noise, and deviations of their parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Complex
from sound.clips.least_squares import fitted_coefficients, inverse, normal_matrix, refined
from sound.synthesis.sinusoids import superposed

FALSE_MODES = 5e-4
"""Expected number of sinusoids in a clip of nothing but noise."""
FALSE_STRONG_MODES, STRONG = 1e-2, 1e-2
"""The same expected number for sinusoids whose spectral peaks are within 40 dB of the highest, in a
clip that has modes, as missing one of these is worse; and that ratio of peaks."""
_LENIENCE = 2.0 * np.log(FALSE_STRONG_MODES / FALSE_MODES)
NEIGHBOURHOOD = 150.0
"""Half-width of the band around a mode whose noise it is compared with, over the mode's damping."""
_SILENCED = 10.0
"""Decay [nepers] at which a window ends."""
_LEAST_LEVEL = 1e-15
"""Least variance of the noise, relative to the peak: that of 24-bit samples."""


@dataclass(frozen=True)
class Fit:
    """Damped sinusoids (k,) fitted to a clip of peak 1, see `sound.synthesis.sinusoids`.

    `exponents` and `coefficients` are in the order of frequency.  `prominence` is the energy that
    the fit would lose without each sinusoid, over `level`, the variance of white noise as strong as
    the noise at it.
    """

    exponents: Complex
    coefficients: Complex
    prominence: Array
    level: Array

    def chosen(self, which: NDArray[Any]) -> Fit:
        """Some of the sinusoids, by mask or numbers."""
        fields = (self.exponents, self.coefficients, self.prominence, self.level)
        return Fit(*(values[which] for values in fields))

    def deviations(self, samples: int) -> Complex:
        """Standard deviations (k,) of the exponents by the noise; real and imaginary part each."""
        matrix = normal_matrix(self.exponents, self.coefficients, samples)
        variances = np.diag(inverse(matrix)).reshape(2, 2, -1)[:, 1]
        real, imaginary = np.sqrt(np.maximum(variances, 0.0) * self.level)
        return np.asarray(real + 1j * imaginary)


def settled(exponents: Complex, clip: Array, steps: int) -> Fit:
    """Refined fit of those exponents to the whole clip that stand out of its noise."""
    fit = _pruned(exponents, clip)
    return _pruned(refined(fit.exponents, fit.coefficients, clip, steps)[0], clip)


def _pruned(exponents: Complex, clip: Array) -> Fit:
    """Fit of the exponents without those that do not stand out of the noise.

    Of neighbours the least prominent one is dropped first: of two estimates of one mode, neither is
    prominent as long as the other is there.
    """
    exponents = exponents[np.argsort(exponents.imag)]
    while True:
        coefficients = fitted_coefficients(exponents, clip)
        rest = clip - superposed(exponents, coefficients, len(clip))
        level = _level(exponents, rest)
        prominence = _gain(exponents, coefficients, len(clip)) / level
        padded = np.pad(prominence, 1, constant_values=np.inf)
        least = (prominence <= padded[:-2]) & (prominence <= padded[2:])
        needed = threshold(exponents, len(clip))
        if (prominence >= needed).any():
            needed = needed - _LENIENCE * _is_strong(exponents, coefficients, len(clip))
        weak = least & (prominence < needed)
        if not weak.any():
            return Fit(exponents, coefficients, prominence, level)
        exponents = exponents[~weak]


def _is_strong(exponents: Complex, coefficients: Complex, samples: int) -> NDArray[np.bool_]:
    """Which sinusoids have spectral peaks within `STRONG` of the highest."""
    peaks = np.abs(coefficients) / np.maximum(-exponents.real, 1.0 / samples)
    return np.asarray(peaks >= STRONG * peaks.max(initial=0.0))


def threshold(exponents: Complex, samples: int) -> Array:
    """Prominence (k,) that `FALSE_MODES` sinusoids of noise alone exceed, on average.

    The prominence of noise has an exponential distribution of mean 2, and the number of distinct
    frequencies is that of bandwidths, by the decay of the sinusoid, in the spectrum.
    """
    decay = np.maximum(-exponents.real, 1.0 / samples)
    frequencies = np.maximum(1.0, 0.5 * np.pi / decay)
    return np.asarray(2.0 * np.log(frequencies / FALSE_MODES))


def _gain(exponents: Complex, coefficients: Complex, samples: int) -> Array:
    """Energy (k,) that each damped sinusoid explains and the others do not."""
    count = len(exponents)
    matrix = normal_matrix(exponents, np.ones(count, complex), samples, order=1)
    blocks = inverse(matrix).reshape(2, count, 2, count)
    own = np.moveaxis(np.diagonal(blocks, axis1=1, axis2=3), -1, 0)
    parts = np.stack([coefficients.real, coefficients.imag], axis=1)
    return np.asarray(np.einsum("ki,kij,kj->k", parts, np.linalg.inv(own), parts))


def _level(exponents: Complex, rest: Array) -> Array:
    """Variance (k,) of white noise as strong as the rest around each sinusoid.

    It is the median, over frequencies around the sinusoid's, of the rest's correlation with
    sinusoids of its decay, rounded to a power of 2.
    """
    slowest = 1.0 / len(rest)
    octaves = np.round(np.log2(np.maximum(-exponents.real, slowest) / slowest))
    level = np.empty(len(exponents))
    for octave in np.unique(octaves):
        rate = slowest * 2.0**octave
        power, size = power_under(rest, rate)
        reach = round(NEIGHBOURHOOD * rate / (2.0 * np.pi) * size)
        for k in np.flatnonzero(octaves == octave):
            bin_number = round(exponents[k].imag / (2.0 * np.pi) * size)
            around = power[max(0, bin_number - reach) : bin_number + reach + 1]
            level[k] = np.median(around) / np.log(2.0)
    return np.maximum(level, _LEAST_LEVEL)


def power_under(rest: Array, decay: float, padding: float = 1.0) -> tuple[Array, int]:
    """Power spectrum of a rest under a window exp(-decay n), and the length that it belongs to.

    The power of white noise is its variance.  The end that the window silences is left out, and
    zeros are added up to `padding` times the length.
    """
    from scipy.fft import next_fast_len, rfft

    kept = rest[: int(_SILENCED / decay) + 1]
    size = next_fast_len(int(padding * len(kept)), real=True)
    window = np.exp(-decay * np.arange(len(kept)))
    spectrum = rfft(kept * window, size)
    return np.asarray((spectrum.real**2 + spectrum.imag**2) / (window @ window)), size
