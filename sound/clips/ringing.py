"""From where on the modes of a strike ring freely.

A blow lasts some milliseconds, in which modes are still driven, or none.  What it sounds like is no
sum of damped sinusoids, and a fit that begins with it has them all wrong.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sound.clips.damped import superposed
from sound.clips.search import SETTLING_STEPS, modes_of, pursued, sinusoids
from sound.clips.significance import Fit, settled

Array = NDArray[np.float64]

LONGEST_BLOW = 0.03
"""Time [s] after the strike from which on modes ring freely."""
BLOW_SHARES = (0.01, 0.03, 0.1, 0.2)
"""Shares of the energy that may come before."""
BLOW_WEIGHT = 1.0 / 3.0
"""What energy before the modes counts, beside energy that they ought to explain and do not."""
PROMISING, WORTH_IT = 1.1, 0.97
"""Share of what the fit from the strike on leaves, up to which a later beginning is looked at more
closely, and up to which it is taken."""
SHORTEST_SAMPLES = 256
"""Samples without which there is nothing to be searched."""


@dataclass(frozen=True)
class Ringing:
    """Sinusoids of a clip from sample `start` on, `whole` with those that are no modes."""

    start: int
    whole: Fit
    modes: Fit

    def cost(self, clip: Array) -> float:
        """Energy of the clip that the modes leave, that before them weighted."""
        before, after = clip[: self.start], clip[self.start :]
        rest = after - superposed(self.modes.exponents, self.modes.coefficients, len(after))
        return float(BLOW_WEIGHT * (before @ before) + rest @ rest)


def ringing(clip: Array, rate: int, visible: bool = False) -> Ringing:
    """Modes of a clip of peak 1 that begins with its strike, from where on they explain most."""
    first = _ringing(0, sinusoids(clip, rate, visible), clip)
    energy = np.cumsum(clip**2)
    latest = max(0, min(round(LONGEST_BLOW * rate), len(clip) - SHORTEST_SAMPLES))
    passed = np.searchsorted(energy, np.array(BLOW_SHARES) * energy[-1])
    later = [int(start) for start in np.unique(np.minimum(passed, latest)) if start]
    exponents = first.modes.exponents
    others = [
        _unchanged(start, settled(exponents, clip[start:], SETTLING_STEPS)) for start in later
    ]
    best = min(others, key=lambda each: each.cost(clip), default=first)
    least = first.cost(clip)
    if best is first or best.cost(clip) > PROMISING * least:
        return first
    best = _ringing(best.start, pursued(best.modes, clip[best.start :], rate), clip)
    return best if best.cost(clip) < WORTH_IT * least else first


def _ringing(start: int, fit: Fit, clip: Array) -> Ringing:
    return Ringing(start, fit, modes_of(fit, clip[start:]))


def _unchanged(start: int, fit: Fit) -> Ringing:
    return Ringing(start, fit, fit)
