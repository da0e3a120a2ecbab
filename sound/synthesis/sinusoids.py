"""Samples of damped sinusoids, by themselves or of a bank that is struck.

A signal is Re sum_k c_k exp(lambda_k n) at sample n = 0, 1, ..., with complex `coefficients` c and
`exponents` lambda = (-d + 2 pi i f) / rate.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Complex

_BLOCK = 512
"""Number of samples that one matrix product computes."""
_SILENT = -300.0
"""Natural logarithm of the largest number that counts as zero."""
BLOCK = 512
"""Number of samples that one matrix product computes for all modes."""
SILENT = -80.0
"""Natural logarithm of the largest amplitude that counts as zero; 1e-35 cannot be heard."""


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


class Bank:
    """Modes s(t) = sum_k a_k exp(-d_k t) sin(2 pi f_k t), which ring on from call to call.

    Each mode is the imaginary part of a complex number that turns and decays.  Blocks of samples
    are one matrix product with the powers of those rotations, so no error builds up from sample to
    sample, and one core makes 4e9 samples of a mode per second: 30 modes at 44.1 kHz 3,000 times
    faster than they sound.  Modes with frequencies f (k,) [Hz] from half the rate [Hz] on stay
    silent; their dampings d (k,) are in 1/s.
    """

    def __init__(self, frequencies: Array, dampings: Array, rate: int) -> None:
        self.rate = rate
        self._exponents, self._heard = sampled_exponents(frequencies, dampings, rate)
        self._state = np.zeros(len(frequencies), dtype=complex)
        turns = np.exp(np.arange(BLOCK)[:, None] * self._exponents)
        self._kernel = np.concatenate([turns.imag, turns.real], axis=1)

    def strike(self, amplitudes: Array, since: float = 0.0) -> None:
        """Add a strike that excites the modes by (k,) amplitudes, `since` samples ago."""
        self._state += self._heard * amplitudes * np.exp(since * self._exponents)

    def advance(self, count: int) -> Array:
        """The next `count` samples."""
        begins = np.arange(0, count, BLOCK)[:, None] * self._exponents
        # Denormal numbers would slow the product down.
        states = self._state * np.where(begins.real > SILENT, np.exp(begins), 0.0)
        samples = np.concatenate([states.real, states.imag], axis=1) @ self._kernel.T
        last = count * self._exponents
        self._state = self._state * np.where(last.real > SILENT, np.exp(last), 0.0)
        return np.asarray(samples.ravel()[:count])


def ring(bank: Bank, strikes: Iterable[tuple[float, Array]], count: int) -> Array:
    """The first `count` samples of a bank that is struck at several times [s] by amplitudes (k,).

    Times between samples are kept exactly.

    Examples
    --------
    >>> bank = Bank(np.array([2.0]), np.array([0.0]), 16)
    >>> ring(bank, [(0.25, np.array([1.0]))], 8).round(3).tolist()
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.707, 1.0, 0.707]
    """
    sound = np.zeros(count)
    done = 0
    for seconds, amplitudes in sorted(strikes, key=lambda strike: strike[0]):
        first = int(np.ceil(seconds * bank.rate))
        if first >= count:
            break
        sound[done:first] = bank.advance(first - done)
        bank.strike(amplitudes, first - seconds * bank.rate)
        done = first
    sound[done:] = bank.advance(count - done)
    return sound
