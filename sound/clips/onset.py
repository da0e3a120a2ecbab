"""Where in a clip the strike is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_QUIETER = 10.0
"""Mean power after the strike over that before it, from which on there is a strike to be found."""


def strike_sample(clip: Array) -> int:
    """Number of the sample where the strike begins; 0 if nothing before it is quieter.

    The sample, at or before the loudest one, that splits the clip up to there best into two
    stretches of white noise of different power (the change point of Maeda 1985).
    """
    loudest = int(np.argmax(np.abs(clip)))
    # As much after the loudest sample as before it, so that both stretches have some length.
    part = clip[: 2 * loudest + 1]
    if loudest < 2 or len(part) < 8:
        return 0
    energy = np.concatenate([[0.0], np.cumsum(part**2)])
    splits = np.arange(1, loudest + 1)
    least = np.finfo(float).eps * energy[-1]
    before = np.maximum(energy[splits], least) / splits
    after = (energy[-1] - energy[splits]) / (len(part) - splits)
    cost = splits * np.log(before) + (len(part) - splits) * np.log(after)
    best = int(np.argmin(cost))
    return int(splits[best]) if after[best] > _QUIETER * before[best] else 0
