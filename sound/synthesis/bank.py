"""Bank of damped modes (appendix, Eq. 3), struck at any time."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from carillon.arrays import Array
from sound.synthesis.sinusoids import sampled_exponents

BLOCK = 512
"""Number of samples that one matrix product computes for all modes."""
SILENT = -80.0
"""Natural logarithm of the largest amplitude that counts as zero; 1e-35 cannot be heard."""


class Bank:
    """Modes s(t) = sum_k a_k exp(-d_k t) sin(2 pi f_k t), which ring on from call to call.

    Each mode is the imaginary part of a complex number that turns and decays.  Blocks of samples
    are one matrix product with the powers of those rotations, so no error builds up from sample to
    sample, and one core makes 4e9 samples of a mode per second: 30 modes at 44.1 kHz 3,000 times
    faster than they sound.

    Parameters
    ----------
    frequencies : (k,) [Hz]
        f.
    dampings : (k,) [1/s]
        d.
    rate : int [Hz]
        Samples per second; modes from half of it on stay silent.
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
    """The first `count` samples of a bank that is struck at several times.

    Parameters
    ----------
    strikes
        Time [s] and amplitudes (k,) of each strike; times between samples are kept exactly.

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
