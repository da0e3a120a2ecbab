"""Where in a clip its modes stop ringing by themselves: at silence added to it, or where it fades.

Sounds of strikes fade ever more slowly, since quick modes go first.  Editors fade a clip to nothing
at its end, which no sum of damped sinusoids does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SILENT = 1e-6
"""Magnitude, over the clip's largest, of added silence."""
_SHORTEST_FADE, _LONGER = 0.01, 1.3
"""Length of the shortest fade that is looked for [s], and factor to the next one's."""
_FALLS = np.array([1.0, 3.0, 9.0])
"""Fall [dB] of the second to the fourth quarter of a fade, beyond what came before, that tells it.
A linear one falls by 4.2, 8.3 and 16.8 dB, that of a cosine by more."""
_PARTS = 8
"""Stretches before a fade, each as long as a quarter of it, from which its levels are foretold."""


def ending(clip: Array, rate: int) -> int:
    """Number of samples of a clip (s,), from its strike on, before silence or a fade at its end."""
    loud = np.flatnonzero(np.abs(clip) > _SILENT * np.abs(clip).max(initial=0.0))
    end = int(loud[-1]) + 1 if len(loud) else len(clip)
    energy = np.concatenate([[0.0], np.cumsum(clip[:end] ** 2)])
    quarter = float(max(2, round(0.25 * _SHORTEST_FADE * rate)))
    faded = 0
    while (_PARTS + 4) * int(quarter) <= end:
        if _fades(energy, int(quarter)):
            faded = 4 * int(quarter)
        quarter *= _LONGER
    return end - faded


def _fades(energy: Array, quarter: int) -> bool:
    """Whether the last four stretches of a length fall as those before them do not."""
    ends = len(energy) - 1 - quarter * np.arange(_PARTS + 4, -1, -1)
    powers = np.diff(energy[ends])
    levels = 10.0 * np.log10(np.maximum(powers, 1e-300))
    slope, level = np.polyfit(np.arange(-_PARTS, 0), levels[:_PARTS], 1)
    # What swells before is expected to stay as it is.
    foretold = level + min(slope, 0.0) * np.arange(4)
    return bool((foretold[1:] - levels[-3:] >= _FALLS).all())
