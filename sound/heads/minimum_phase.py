"""Minimum-phase responses of magnitudes, by the real cepstrum (Oppenheim and Schafer, ch. 13)."""

import numpy as np
from scipy.fft import irfft, rfft

from carillon.arrays import Array


def minimum_phase(log_magnitudes: Array) -> Array:
    """Responses (..., n) from natural logarithms (..., n / 2 + 1) of their magnitudes.

    Examples
    --------
    >>> late = np.array([0.0, 0.0, 1.0, 0.5, 0.0, 0.0, 0.0, 0.0] + 24 * [0.0])
    >>> (minimum_phase(np.log(np.abs(np.fft.rfft(late))))[:3].round(4) + 0.0).tolist()
    [1.0, 0.5, 0.0]
    """
    count = 2 * (log_magnitudes.shape[-1] - 1)
    cepstrum = irfft(log_magnitudes, count)
    # The part before time zero is folded onto the part behind.
    cepstrum[..., 1 : count // 2] *= 2.0
    cepstrum[..., count // 2 + 1 :] = 0.0
    return np.asarray(irfft(np.exp(rfft(cepstrum)), count))
