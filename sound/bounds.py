"""Bounds of sounds that are read or made; beyond them is a mistake, or too much for memory."""

from typing import Annotated

from carillon.errors import UserError
from carillon.parameters import Check
from carillon.parameters.quantities import between

LOWEST_RATE, HIGHEST_RATE = 1_000, 768_000
"""Least and greatest sampling rate [Hz] of clips and of rendered sounds."""
MOST_CHANNELS = 16
"""Greatest number of channels of a clip."""
MOST_CLIP_SAMPLES = 1 << 23
"""Greatest number of samples of a clip, in all channels: three minutes at 44.1 kHz."""
MOST_SAMPLES = 1 << 26
"""Greatest number of samples of a rendered sound: 10 minutes at 96 kHz, half a gigabyte of
memory."""
LONGEST_SOUND = 600.0
"""Greatest length [s] of a rendered sound."""
LONGEST_COMPARED = 30.0
"""Greatest length [s] of the part of a clip that a strike is as loud as."""
LONGEST_CONTACT = 1.0
"""Greatest duration of a strike's force [s]."""
LEAST_IMPULSE, LARGEST_IMPULSE = 1e-6, 1e6
"""Least and greatest impulse of a strike [N s]."""
QUIETEST, LOUDEST = 1e-9, 1e6
"""Least and greatest magnitude of the loudest sample of a clip, full scale being 1."""

SampleRate = Annotated[int, between(LOWEST_RATE, HIGHEST_RATE)]
"""Samples per second [Hz]."""
ContactSeconds = Annotated[float, between(0.0, LONGEST_CONTACT)]
"""Duration of a strike's force [s]; 0 is an impulse."""


FLOAT_BITS = 32
"""Bits of a sample that is a floating-point number."""
WHOLE_BITS = (16, 24)
"""Bits of samples that are whole numbers."""


def _bits(value: int) -> int:
    if value not in (*WHOLE_BITS, FLOAT_BITS):
        raise ValueError(f"found {value}, expected 16, 24 or 32")
    return value


SampleBits = Annotated[int, Check(_bits)]


def require_level(peak: float) -> None:
    """Refuse a clip whose loudest sample has an impossible magnitude.

    Raises UserError if `peak` is not within `QUIETEST` and `LOUDEST`.
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
    """Refuse a length without a sample, or of more than `MOST_SAMPLES`.

    Raises UserError if it is such a length.
    """
    count = seconds * rate
    if not 0.5 < count <= MOST_SAMPLES:
        raise UserError(
            f"{seconds:g} s at {rate:,} samples per second make {count:.3g} samples, expected 1 to "
            f"{MOST_SAMPLES:,}"
        )
