"""Errors of eigenvalues and frequencies that are matched by index."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carillon.fem.model import RIGID_MODES

Array = NDArray[np.float64]

AUDIBLE_FIRST, AUDIBLE_LAST = 7, 60
"""Mode numbers, from 1, of the frequency errors that are reported for coarsened models."""


@dataclass(frozen=True)
class FrequencyErrors:
    """Relative errors of the frequencies of modes `first`..`last`, matched by index.

    Attributes
    ----------
    rms, mean
        Root mean square and signed mean.
    worst, worst_mode
        The error of largest magnitude, with its sign, and the mode that has it.
    """

    first: int
    last: int
    rms: float
    mean: float
    worst: float
    worst_mode: int


def frequency_errors(errors: Array, last: int) -> FrequencyErrors:
    """Summary of the relative `errors` (k,) of modes 7, 8, ... up to `last`, if there are so many.

    Examples
    --------
    >>> frequency_errors(np.array([0.25, -0.5, 1.0]), last=8)
    FrequencyErrors(first=7, last=8, rms=0.395..., mean=-0.125, worst=-0.5, worst_mode=8)
    """
    part = errors[: last - RIGID_MODES]
    worst = int(np.argmax(np.abs(part)))
    first = RIGID_MODES + 1
    return FrequencyErrors(
        first,
        RIGID_MODES + len(part),
        float(np.sqrt(np.mean(part**2))),
        float(np.mean(part)),
        float(part[worst]),
        first + worst,
    )


def eigenvalue_errors(values: Array, exact: Array) -> dict[str, float]:
    """Median, 90th percentile and maximum of |values - exact| / exact, matched by index.

    Examples
    --------
    >>> eigenvalue_errors(np.array([1.0, 2.5, 4.0]), np.array([1.0, 2.0, 4.0]))["max"]
    0.25
    """
    error = np.abs(values / exact - 1.0)
    return {
        "median": float(np.median(error)),
        "p90": float(np.quantile(error, 0.9)),
        "max": float(error.max()),
    }
