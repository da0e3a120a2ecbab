"""Distances of frequencies in cents, by themselves and up to a common factor."""

from __future__ import annotations

import numpy as np

from carillon.arrays import Array

CENTS = 1200.0
"""Number of cents in an octave."""


def common_factor(frequencies: Array, targets: Array) -> float:
    """The factor of frequencies (N,) that brings them nearest to targets (N,), in cents.

    Least squares of logarithms: a geometric mean.
    """
    return float(np.exp(np.mean(np.log(targets / frequencies))))


def cents(frequencies: Array, targets: Array) -> Array:
    """Distances (N,) [cents] of frequencies (N,) above targets (N,).

    Examples
    --------
    >>> cents(np.array([440.0, 880.0]), np.array([440.0, 440.0]))
    array([   0., 1200.])
    """
    return np.asarray(CENTS * np.log2(frequencies / targets))


def rms_cents(frequencies: Array, targets: Array) -> float:
    """Root mean square [cents] of the distances that remain after the best common factor."""
    scaled = common_factor(frequencies, targets) * frequencies
    return float(np.sqrt(np.mean(cents(scaled, targets) ** 2)))
