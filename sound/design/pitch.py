"""Frequencies as the ear spaces them: distances in cents, and critical-band rate."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from carillon.arrays import Array

if TYPE_CHECKING:
    from sound.clips.targets import Targets

CENTS = 1200.0
"""Number of cents in an octave."""
_NARROW_HERTZ, _WIDE_HERTZ = 1000.0 / 0.76, 7500.0


def stretch_to(frequencies: Array, targets: Targets) -> float:
    """The factor of frequencies (N,) that brings those of partials nearest to their targets."""
    which = targets.sounding
    return common_factor(frequencies[which], targets.frequencies[which])


def rms_off_partials(frequencies: Array, targets: Targets) -> float:
    """`rms_cents` of the partials among frequencies (N,) [Hz], silent modes aside."""
    which = targets.sounding
    return rms_cents(frequencies[which], targets.frequencies[which])


def partials_alone(values: Array, targets: Targets) -> list[float | None]:
    """Values (N,) of modes, None of those that shall stay silent."""
    kept: list[float | None] = [None] * len(values)
    for mode in targets.sounding:
        kept[mode] = float(values[mode])
    return kept


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


def partials_off(hertz: Array, targets: Targets) -> dict[str, float]:
    """Median and worst distance [cents] of the partials among frequencies (N,) [Hz] of modes."""
    off = np.abs(cents(hertz, targets.frequencies))[targets.sounding]
    return {"median_cents": float(np.median(off)), "worst_cents": float(off.max())}


def bark(frequencies: Array) -> Array:
    """Critical-band rate [bark] of frequencies [Hz] (Zwicker and Terhardt 1980, in [ZF99]).

    Examples
    --------
    >>> np.round(bark(np.array([100.0, 1000.0, 10000.0])), 1)
    array([ 1. ,  8.5, 22.4])
    """
    f = np.asarray(frequencies, dtype=float)
    return np.asarray(13.0 * np.arctan(f / _NARROW_HERTZ) + 3.5 * np.arctan((f / _WIDE_HERTZ) ** 2))


def bark_slope(frequencies: Array) -> Array:
    """Derivative [bark/Hz] of `bark`."""
    f = np.asarray(frequencies, dtype=float)
    narrow, wide = f / _NARROW_HERTZ, f / _WIDE_HERTZ
    return np.asarray(
        13.0 / (_NARROW_HERTZ * (1.0 + narrow**2)) + 7.0 * wide / (_WIDE_HERTZ * (1.0 + wide**4))
    )
