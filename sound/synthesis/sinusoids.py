"""Samples of damped sinusoids.

A signal is Re sum_k c_k exp(lambda_k n) at sample n = 0, 1, ..., with complex `coefficients` c and
`exponents` lambda = (-d + 2 pi i f) / rate.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Complex

_BLOCK = 512
"""Number of samples that one matrix product computes."""
_SILENT = -300.0
"""Natural logarithm of the largest number that counts as zero."""


def exponents_of(frequencies: Array, dampings: Array, rate: int) -> Complex:
    """Exponents (k,) per sample of frequencies [Hz] and dampings [1/s]."""
    return np.asarray((-dampings + 2j * np.pi * frequencies) / rate)


def sampled_exponents(
    frequencies: Array, dampings: Array, rate: int
) -> tuple[Complex, NDArray[np.bool_]]:
    """Exponents (k,) per sample, and whether a frequency [Hz] is below half the `rate` [Hz].

    The exponents of the others are those of frequency 0.
    """
    heard = frequencies < rate / 2.0
    return exponents_of(np.where(heard, frequencies, 0.0), dampings, rate), heard


def damped_sinusoids(
    frequencies: Array, dampings: Array, amplitudes: Array, phases: Array, rate: int, count: int
) -> Array:
    """Samples (count,) of sum_k a_k exp(-d_k t) sin(2 pi f_k t + theta_k), t = n / rate.

    Parameters
    ----------
    frequencies : (k,) [Hz]
        f.
    dampings : (k,) [1/s]
        d.
    amplitudes : (k,)
        a, in any unit.
    phases : (k,) [rad]
        theta.
    rate : int [Hz]
        Samples per second.
    count : int
        Number of samples.

    Examples
    --------
    >>> one = np.ones(1)
    >>> damped_sinusoids(one, 0.0 * one, one, 0.0 * one, rate=4, count=5).round(6) + 0.0
    array([ 0.,  1.,  0., -1.,  0.])
    """
    coefficients = -1j * np.asarray(amplitudes) * np.exp(1j * np.asarray(phases))
    return superposed(exponents_of(frequencies, dampings, rate), coefficients, count)


def superposed(exponents: Complex, coefficients: Complex, count: int) -> Array:
    """Samples (count,) of Re sum_k c_k exp(lambda_k n)."""
    cosines, sines, starts = _turns(exponents, count)
    weights = starts * coefficients
    blocks = _real(weights) @ cosines.T - _real(-1j * weights) @ sines.T
    return np.asarray(blocks.ravel()[:count])


def correlations(exponents: Complex, signal: Array) -> Complex:
    """Sums (2, k) over the samples of signal[n] exp(lambda_k n) and of the same times n."""
    cosines, sines, starts = _turns(exponents, len(signal))
    blocks = np.zeros((len(starts), len(cosines)))
    blocks.ravel()[: len(signal)] = signal
    later = blocks * np.arange(len(cosines))
    first = np.arange(len(starts)) * len(cosines)
    plain = starts * (blocks @ cosines + 1j * (blocks @ sines))
    slope = starts * (later @ cosines + 1j * (later @ sines)) + first[:, None] * plain
    return np.stack([plain.sum(axis=0), slope.sum(axis=0)])


def _turns(exponents: Complex, count: int) -> tuple[Array, Array, Complex]:
    """Real and imaginary part (b, k) of exp(lambda_k n) in the first block, (m, k) at each block.

    exp(lambda_k n) at any sample is the value at its block's first one times that in the block.
    """
    size = min(_BLOCK, max(count, 1))
    within = _powers(exponents, size)
    starts = _powers(size * exponents, -(-count // size))
    return _real(within), _real(-1j * within), starts


def _powers(exponents: Complex, count: int) -> Complex:
    """exp(lambda_k n) (count, k) for n = 0 .. count - 1, by repeated doubling."""
    powers = np.ones((1, len(exponents)), complex)
    while len(powers) < count:
        turn = len(powers) * exponents
        # Denormal numbers would slow the products down.
        turn = np.where(turn.real > _SILENT, np.exp(turn), 0.0)
        powers = np.concatenate([powers, turn * powers[: count - len(powers)]])
    return powers


def _real(values: Complex) -> Array:
    """Real parts side by side, as BLAS wants them."""
    return np.ascontiguousarray(values.real)
