"""Bounds of sounds, read or made: what is beyond them is a mistake, or more than memory holds."""

from __future__ import annotations

from typing import Annotated

from carillon.errors import UserError
from carillon.parameters.quantities import between

LOWEST_RATE, HIGHEST_RATE = 1_000, 768_000
"""Samples per second [Hz] of clips and of what is rendered."""
MOST_CHANNELS = 16
"""Of a clip; their mean is taken, which of many microphones says nothing."""
MOST_CLIP_SAMPLES = 1 << 23
"""Of a clip, in all channels: three minutes at 44.1 kHz, of which a strike needs seconds."""
MOST_SAMPLES = 1 << 26
"""Of a sound that is made: 10 minutes at 96 kHz, half a gigabyte while it is worked out."""
LONGEST_SOUND = 600.0
"""Length [s] of a sound that somebody may want to hear."""
LEAST_IMPULSE, LARGEST_IMPULSE = 1e-6, 1e6
"""What somebody may strike with [N s]."""
QUIETEST, LOUDEST = 1e-9, 1e6
"""Magnitude of the loudest sample of a clip, full scale being 1."""

SampleRate = Annotated[int, between(LOWEST_RATE, HIGHEST_RATE)]
"""Samples per second [Hz]."""


def require_level(peak: float) -> None:
    """Refuse a clip whose loudest sample has a magnitude that no recording has.

    Raises
    ------
    UserError
        If `peak` is not within `QUIETEST` and `LOUDEST`.
    """
    if peak > LOUDEST:
        raise UserError(
            f"reaches {peak:.3g} times full scale, expected at most {LOUDEST:g}; scale it down"
        )
    if peak < QUIETEST:
        raise UserError(
            f"is silent, or nearly so: it reaches {peak:.3g} of full scale, expected the sound of "
            "a strike"
        )


def require_length(seconds: float, rate: int) -> None:
    """Refuse to make a sound without a sample, or of more than `MOST_SAMPLES`.

    Raises
    ------
    UserError
        If it would have so few or so many.
    """
    count = seconds * rate
    if not 0.5 < count <= MOST_SAMPLES:
        raise UserError(
            f"{seconds:g} s at {rate:,} samples per second make {count:.3g} samples, expected 1 to "
            f"{MOST_SAMPLES:,}"
        )
