"""Samples at full scale: where a clip is clipped, and what its modes say of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sound.clips.damped import superposed
from sound.clips.ringing import Ringing, ringing
from sound.clips.search import SETTLING_STEPS
from sound.clips.significance import settled

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FULL_SCALE = 0.9999
"""Magnitude from which on a sample is at the end of its format's range."""
CLIPPED_RUN = 4
"""Equal samples in a row at full scale that no unclipped sound has, but at very low frequencies."""
SHARES = (1e-2, 1e-4)
"""Energy of the weakest mode, over that of the strongest, that is asked for clipped samples; what
clipping adds is weaker."""
ROUNDS = 10
"""Times that clipped samples are taken from these modes, and the modes fitted anew."""
HIGHEST = 4.0
"""Magnitude that a clipped sample may have had, over full scale."""


def is_clipped(samples: Array) -> Mask:
    """Which samples (s,) are at full scale: none, if they are nowhere equal for long enough."""
    magnitudes = np.abs(samples)
    full = magnitudes >= FULL_SCALE * max(1.0, magnitudes.max(initial=0.0))
    starts = np.flatnonzero(np.diff(samples, prepend=np.nan) != 0.0)
    lengths = np.diff(starts, append=len(samples))
    return full if (full[starts] & (lengths >= CLIPPED_RUN)).any() else np.zeros_like(full)


def restored(clip: Array, clipped: Mask, rate: int, visible: bool = False) -> tuple[Ringing, Array]:
    """Modes of a clip that its clipped samples have no say in, and the clip with what they were.

    Each takes what the modes say of it, but no less than full scale, and the modes are fitted anew
    until both agree: least squares over the other samples alone, by expectation and maximisation.
    """
    found, whole = ringing(clip, rate, visible), clip.copy()
    for share in SHARES:
        modes, after, missing = found.modes, whole[found.start :], clipped[found.start :]
        energies = np.abs(modes.coefficients) ** 2 / -modes.exponents.real
        modes = modes.chosen(energies >= share * energies.max(initial=0.0))
        signs = np.sign(after[missing])
        for _ in range(ROUNDS):
            model = superposed(modes.exponents, modes.coefficients, len(after))[missing]
            after[missing] = signs * np.clip(signs * model, 1.0, HIGHEST)
            modes = settled(modes.exponents, after, SETTLING_STEPS)
        found = ringing(whole, rate, visible)
    return found, whole
