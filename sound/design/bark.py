"""Critical-band rate: frequency as the ear spaces it."""

from __future__ import annotations

import numpy as np

from carillon.arrays import Array

_NARROW_HERTZ, _WIDE_HERTZ = 1000.0 / 0.76, 7500.0


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
