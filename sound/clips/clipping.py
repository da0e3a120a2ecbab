"""Clipping: which samples are clipped, and their restoration from the modes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from sound.clips.free_vibration import FreeModes, free_modes
from sound.clips.mode_search import SETTLING_STEPS
from sound.clips.significance import settled
from sound.synthesis.sinusoids import superposed

Mask = NDArray[np.bool_]

FULL_SCALE = 0.9999
"""Least magnitude of a sample at full scale, over full scale."""
CLIPPED_RUN = 4
"""Least number of equal samples in a row, at full scale, of a clipped clip; without clipping only
very low frequencies have such rows."""
SHARES = (1e-2, 1e-4)
"""Least energy of the modes that clipped samples are restored from, over that of the strongest, one
after the other; sinusoids that clipping adds are weaker."""
ROUNDS = 10
"""Number of times that clipped samples are restored from the modes, and the modes fitted again."""
HIGHEST = 4.0
"""Greatest magnitude of a restored sample, over full scale."""


def is_clipped(samples: Array) -> Mask:
    """Which samples (s,) are clipped: those at full scale, if `CLIPPED_RUN` in a row are equal."""
    magnitudes = np.abs(samples)
    full = magnitudes >= FULL_SCALE * max(1.0, magnitudes.max(initial=0.0))
    starts = np.flatnonzero(np.diff(samples, prepend=np.nan) != 0.0)
    lengths = np.diff(starts, append=len(samples))
    return full if (full[starts] & (lengths >= CLIPPED_RUN)).any() else np.zeros_like(full)


def restored(
    clip: Array, clipped: Mask, rate: int, visible: bool = False
) -> tuple[FreeModes, Array]:
    """Modes of a clipped clip, fitted to its other samples alone, and the clip restored from them.

    The least squares over the other samples are found by expectation and maximisation: clipped
    samples take the values of the modes, but at least full scale, and the modes are fitted again,
    in turn.
    """
    free, whole = free_modes(clip, rate, visible), clip.copy()
    for share in SHARES:
        modes, after, missing = free.modes, whole[free.start :], clipped[free.start :]
        energies = np.abs(modes.coefficients) ** 2 / -modes.exponents.real
        modes = modes.chosen(energies >= share * energies.max(initial=0.0))
        signs = np.sign(after[missing])
        for _ in range(ROUNDS):
            model = superposed(modes.exponents, modes.coefficients, len(after))[missing]
            after[missing] = signs * np.clip(signs * model, 1.0, HIGHEST)
            modes = settled(modes.exponents, after, SETTLING_STEPS)
        free = free_modes(whole, rate, visible)
    return free, whole
