"""Errors that frequencies are expected to have."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.fem.model import RIGID_MODES

Array = NDArray[np.float64]

FIRST = RIGID_MODES + 1
"""Number of the first mode whose error is estimated."""
LAST = 60
"""Number of the last mode whose error is estimated."""
FROM_FINE, FROM_SOLID = "expected_frequency_error", "solid_frequency_error"
"""Prefixes of the attributes with errors against the fine voxels and against the solid."""
WORST = 3.0
"""Largest error of a frequency, as a multiple of their allowed root mean square."""


@dataclass(frozen=True)
class ExpectedErrors:
    """Expected relative errors (k,) of the frequencies of modes 7, 8, ... up to `LAST` at most.

    Examples
    --------
    >>> expected = ExpectedErrors(np.array([0.3, -0.4]))
    >>> round(expected.rms, 3), expected.worst, expected.worst_mode, expected.last
    (0.354, -0.4, 8, 8)
    """

    errors: Array

    @property
    def rms(self) -> float:
        """Root mean square of the errors."""
        return float(np.sqrt(np.mean(self.errors**2)))

    @property
    def worst(self) -> float:
        """Error of largest magnitude, with its sign."""
        return float(self.errors[np.abs(self.errors).argmax()])

    @property
    def worst_mode(self) -> int:
        """Number of the mode that has it, from 1."""
        return FIRST + int(np.abs(self.errors).argmax())

    @property
    def last(self) -> int:
        """Number of the last mode."""
        return RIGID_MODES + len(self.errors)

    def excess(self, tolerance: float) -> float:
        """How many times as large as allowed the errors are: their rms, or a third of the worst."""
        return max(self.rms, abs(self.worst) / WORST) / tolerance

    def attributes(self, prefix: str) -> dict[str, Any]:
        """Plain values for a file, under names with this beginning; see `in_words`."""
        return {
            f"{prefix}_rms": self.rms,
            f"{prefix}_worst": self.worst,
            f"{prefix}_worst_mode": self.worst_mode,
            f"{prefix}_modes": [FIRST, self.last],
        }


def in_words(attributes: dict[str, Any], prefix: str) -> str:
    """A sentence's end about errors that a file's attributes tell."""
    first, last = attributes[f"{prefix}_modes"]
    return (
        f"of frequencies {first} to {last}: {attributes[f'{prefix}_rms']:.1%} rms, worst "
        f"{attributes[f'{prefix}_worst']:+.1%} (mode {attributes[f'{prefix}_worst_mode']})"
    )
