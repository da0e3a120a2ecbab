"""Levels and endings of sounds that game engines play: trimmed, faded, at one peak."""

import numpy as np

from carillon.arrays import Array
from sound.levels import fade_of_ringing, faded

PEAK_DECIBELS = -1.0
"""Peak of a sound [dB of full scale]: converters and codecs overshoot a little."""
TAIL_DECIBELS = -60.0
"""Level below the peak [dB] from which on the end of a sound is cut."""
FADE_SECONDS = 0.02
"""Time in which an end at that level fades to silence."""


def mastered(sound: Array, rate: int) -> tuple[Array, float]:
    """A sound (s,) without its inaudible end, faded, at the peak, and what it was multiplied by.

    Silence stays as it is, times 1.

    Examples
    --------
    >>> ringing = 0.25 * np.exp(-np.arange(8000) / 500.0)
    >>> made, gain = mastered(ringing, 8000)
    >>> len(made), float(made[0].round(4)), float(made[-1]), round(gain, 4)
    (3454, 0.8913, 0.0, 3.565)
    """
    largest = float(np.abs(sound).max(initial=0.0))
    if largest == 0.0:
        return sound, 1.0
    last = int(np.flatnonzero(np.abs(sound) > largest * 10.0 ** (TAIL_DECIBELS / 20.0))[-1])
    rings = last + 1 > len(sound) - FADE_SECONDS * rate
    seconds = fade_of_ringing(len(sound) / rate) if rings else FADE_SECONDS
    made = faded(sound[: last + 1], rate, max(seconds, 1.0 / rate))[0]
    # The fade may take the largest sample along where a sound is shorter.
    gain = 10.0 ** (PEAK_DECIBELS / 20.0) / float(np.abs(made).max())
    return gain * made, gain
