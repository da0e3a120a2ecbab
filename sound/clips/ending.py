"""End of a clip's free decay: where silence was added, or a fade-out begins.

The sound of a strike decays ever more slowly, since quick modes die away first.  A fade-out of an
editor ends in silence, which no sum of damped sinusoids does.
"""

from __future__ import annotations

import numpy as np

from carillon.arrays import Array

_SILENT = 1e-6
"""Greatest magnitude of added silence, over the clip's largest."""
_SHORTEST_FADE, _LONGER = 0.01, 1.3
"""Length of the shortest fade that is looked for [s], and ratio of successive lengths."""
_FALLS = np.array([1.0, 3.0, 9.0])
"""Least falls [dB] of the second, third and fourth quarter of a fade below the level extrapolated
from before it.  A linear fade falls by 4.2, 8.3 and 16.8 dB, one by a cosine by more."""
_PARTS = 8
"""Number of intervals before a fade, each a quarter of it long, that give the expected levels."""


def ending(clip: Array, rate: int) -> int:
    """Number of samples of a clip (s,) before the silence or fade-out at its end."""
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
    """Whether the last four intervals of `quarter` samples are a fade-out."""
    ends = len(energy) - 1 - quarter * np.arange(_PARTS + 4, -1, -1)
    powers = np.diff(energy[ends])
    levels = 10.0 * np.log10(np.maximum(powers, 1e-300))
    slope, level = np.polyfit(np.arange(-_PARTS, 0), levels[:_PARTS], 1)
    # A level that rises before is expected to stay.
    expected = level + min(slope, 0.0) * np.arange(4)
    return bool((expected[1:] - levels[-3:] >= _FALLS).all())
