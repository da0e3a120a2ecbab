"""What struck points shall sound like: modal parameters shared by several clips."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Targets:
    """Frequencies and dampings common to all clips, and each clip's amplitudes (§5).

    Attributes
    ----------
    names
        Of the T clips.
    frequencies
        (N,) [Hz], ascending.
    dampings
        (N,) [1/s].
    amplitudes
        (T, N) in samples, >= 0; 0 where the clip of that position has no such mode.
    residuals
        T arrays of samples: each clip less its modes, from the strike on.
    rates
        T sampling rates [Hz].
    """

    names: tuple[str, ...]
    frequencies: Array
    dampings: Array
    amplitudes: Array
    residuals: tuple[Array, ...]
    rates: tuple[int, ...]
