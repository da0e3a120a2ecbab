"""How far frequencies are from others, once a factor common to all is free."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CENTS = 1200.0
"""In an octave."""


def common_factor(frequencies: Array, wanted: Array) -> float:
    """The factor of frequencies (N,) that brings them nearest to those `wanted` (N,), in cents.

    Least squares of logarithms: a geometric mean.
    """
    return float(np.exp(np.mean(np.log(wanted / frequencies))))


def cents(frequencies: Array, wanted: Array) -> Array:
    """Distances (N,) [cents] of frequencies (N,) above those `wanted` (N,).

    Examples
    --------
    >>> cents(np.array([440.0, 880.0]), np.array([440.0, 440.0]))
    array([   0., 1200.])
    """
    return np.asarray(CENTS * np.log2(frequencies / wanted))


def rms_cents(frequencies: Array, wanted: Array) -> float:
    """Root mean square [cents] of the distances that the best common factor leaves."""
    scaled = common_factor(frequencies, wanted) * frequencies
    return float(np.sqrt(np.mean(cents(scaled, wanted) ** 2)))
