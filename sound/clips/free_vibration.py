"""Free vibration after a strike: where it begins, and its modes.

A blow lasts some milliseconds, in which it still drives the modes.  The sound of the blow is no sum
of damped sinusoids, and a fit that includes it has all modes wrong.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array
from sound.clips.mode_search import SETTLING_STEPS, modes_of, pursued, sinusoids
from sound.clips.significance import Fit, settled
from sound.synthesis.sinusoids import superposed

LONGEST_BLOW = 0.03
"""Greatest duration of a blow [s]; after it the modes vibrate freely."""
BLOW_SHARES = (0.01, 0.03, 0.1, 0.2)
"""Shares of the clip's energy in the blow that are tried, one after the other."""
BLOW_WEIGHT = 1.0 / 3.0
"""Weight of the blow's energy in the cost of a fit, where unexplained energy after it has 1."""
PROMISING, WORTH_IT = 1.1, 0.97
"""Greatest cost of a later beginning, over the cost of the fit from the strike on, for which it is
refined, and for which it is taken."""
SHORTEST_SAMPLES = 256
"""Least number of samples that are searched for modes."""


@dataclass(frozen=True)
class FreeModes:
    """Damped sinusoids of a clip from sample `start` on: `modes`, and `whole` with those that are
    no modes.
    """

    start: int
    whole: Fit
    modes: Fit

    def cost(self, clip: Array) -> float:
        """Weighted energy of the blow, plus the energy after it that the modes do not explain."""
        before, after = clip[: self.start], clip[self.start :]
        rest = after - superposed(self.modes.exponents, self.modes.coefficients, len(after))
        return float(BLOW_WEIGHT * (before @ before) + rest @ rest)


def free_modes(clip: Array, rate: int, visible: bool = False) -> FreeModes:
    """Modes of a clip of peak 1 that begins with its strike, from the start of least cost on."""
    first = _from(0, sinusoids(clip, rate, visible), clip)
    energy = np.cumsum(clip**2)
    latest = max(0, min(round(LONGEST_BLOW * rate), len(clip) - SHORTEST_SAMPLES))
    passed = np.searchsorted(energy, np.array(BLOW_SHARES) * energy[-1])
    later = []
    for start in map(int, np.unique(np.minimum(passed, latest))):
        if start:
            fit = settled(first.modes.exponents, clip[start:], SETTLING_STEPS)
            later.append(FreeModes(start, fit, fit))
    best = min(later, key=lambda each: each.cost(clip), default=first)
    least = first.cost(clip)
    if best is first or best.cost(clip) > PROMISING * least:
        return first
    best = _from(best.start, pursued(best.modes, clip[best.start :], rate), clip)
    return best if best.cost(clip) < WORTH_IT * least else first


def _from(start: int, fit: Fit, clip: Array) -> FreeModes:
    return FreeModes(start, fit, modes_of(fit, clip[start:]))
