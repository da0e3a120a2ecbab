"""Free vibration after a strike: where it begins, its modes, and clipped samples restored by these.

A blow lasts some milliseconds, in which it still drives the modes.  The sound of the blow is no sum
of damped sinusoids, and a fit that includes it has all modes wrong.
"""

from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array, Flags
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


def is_clipped(samples: Array) -> Flags:
    """Which samples (s,) are clipped: those at full scale, if `CLIPPED_RUN` in a row are equal."""
    magnitudes = np.abs(samples)
    full = magnitudes >= FULL_SCALE * max(1.0, magnitudes.max(initial=0.0))
    starts = np.flatnonzero(np.diff(samples, prepend=np.nan) != 0.0)
    lengths = np.diff(starts, append=len(samples))
    return full if (full[starts] & (lengths >= CLIPPED_RUN)).any() else np.zeros_like(full)


def restored(
    clip: Array, clipped: Flags, rate: int, visible: bool = False
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
