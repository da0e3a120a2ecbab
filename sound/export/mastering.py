"""Levels of sounds that game engines play: begun softly, trimmed, faded, at one peak."""

import numpy as np

from carillon.arrays import Array
from sound.levels import FULL, fade_of_ringing, faded, limiting_gains

PEAK_DECIBELS = -1.0
"""Peak of a sound [dB of full scale]: converters and codecs overshoot a little."""
TAIL_DECIBELS = -60.0
"""Level below the peak [dB] from which on the end of a sound is cut."""
FADE_SECONDS = 0.02
"""Time in which an end at that level fades to silence."""

ONSET_SECONDS, AFTER_SECONDS = 0.001, 0.006
"""Time in which all modes begin in step, whose sum is a peak that the clip does not have, and time
up to which that is compared with what follows."""
ONSET_DECIBELS = 6.0
"""Greatest attenuation of that peak."""


def mastered(sound: Array, rate: int) -> tuple[Array, float]:
    """A sound (s,) without its inaudible end, faded, at the peak, and what it was multiplied by.

    A peak of the onset alone is attenuated before, as it would make all else faint.  Silence stays
    as it is, times 1.

    Examples
    --------
    >>> ringing = 0.25 * np.exp(-np.arange(8000) / 500.0)
    >>> made, gain = mastered(ringing, 8000)
    >>> len(made), float(made[0].round(4)), float(made[-1]), round(gain, 4)
    (3454, 0.8913, 0.0, 3.6225)
    """
    largest = float(np.abs(sound).max(initial=0.0))
    if largest == 0.0:
        return sound, 1.0
    last = int(np.flatnonzero(np.abs(sound) > largest * 10.0 ** (TAIL_DECIBELS / 20.0))[-1])
    sound = sound * onset_gains(sound, rate)
    rings = last + 1 > len(sound) - FADE_SECONDS * rate
    seconds = fade_of_ringing(len(sound) / rate) if rings else FADE_SECONDS
    made = faded(sound[: last + 1], rate, max(seconds, 1.0 / rate))[0]
    # The fade may take the largest sample along where a sound is shorter.
    gain = 10.0 ** (PEAK_DECIBELS / 20.0) / float(np.abs(made).max())
    return gain * made, gain


def onset_gains(sound: Array, rate: int) -> Array:
    """Gains (s,) that lower the peak of a sound's (s,) onset to what follows, 1 elsewhere."""
    first, last = round(ONSET_SECONDS * rate), round(AFTER_SECONDS * rate)
    peak = float(np.abs(sound[:first]).max(initial=0.0))
    after = float(np.abs(sound[first:last]).max(initial=0.0))
    excess = peak / after if after > 0.0 else 1.0
    if excess <= 1.0 or peak < float(np.abs(sound).max()):
        return np.ones(len(sound))
    above = min(excess, 10.0 ** (ONSET_DECIBELS / 20.0))
    return limiting_gains(FULL * above / peak * sound, rate)
