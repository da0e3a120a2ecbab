"""From strikes to samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.response.response import SAMPLE_RATE_HERTZ, half_sine
from sound.rendering.bank import Bank, ring
from sound.rendering.listening import Listening
from sound.rendering.solid import SoundingSolid

Array = NDArray[np.float64]

DECAY_NEPERS = np.log(1e3)
"""Decay by 60 dB."""
LONGEST_SECONDS = 6.0


@dataclass(frozen=True)
class Hit:
    """A strike at a time [s], at a point (3,) [m] of the surface, by an impulse (3,) [N s]."""

    seconds: float
    position: Array
    impulse: Array


def render(
    solid: SoundingSolid,
    hits: Sequence[Hit],
    seconds: float,
    rate: int = SAMPLE_RATE_HERTZ,
    contact_seconds: float = 0.0,
    listening: Listening | None = None,
    residual: bool = True,
) -> Array:
    """The sound (s,) of one strike or many; strikes superpose.

    Parameters
    ----------
    solid
        What sounds.
    hits
        Its strikes.
    seconds : float [s]
        Length.
    rate : int [Hz]
        Samples per second.  Modes from half of it on are left out.
    contact_seconds : float [s]
        Duration of the force, half a sine; 0 is an impulse.  A force that takes longer excites
        high modes less.  It does not change the residuals, which come from a recording.
    listening
        Loudness and residuals of a design's clips: samples are then of full scale as the clips' are
        and residuals are added in proportion to |impulse| over 1 N s.  Without it samples are the
        plain sum of the modes' amplitudes [kg^-1/2 N s].
    residual : bool
        Whether residuals are added.
    """
    count = round(seconds * rate)
    positions = np.array([hit.position for hit in hits])
    amplitudes = solid.amplitudes(positions, np.array([hit.impulse for hit in hits]))
    if listening is not None:
        amplitudes *= np.array([[listening.gain(position)] for position in positions])
    bank = Bank(solid.frequencies, solid.dampings, rate)
    sound = ring(bank, zip([hit.seconds for hit in hits], amplitudes), count)
    if contact_seconds > 0.0:
        from scipy.signal import fftconvolve  # Loaded where it is needed: it takes long.

        sound = fftconvolve(sound, half_sine(contact_seconds, rate))[:count]
    if listening is not None and residual:
        for hit in hits:
            _add_residual(sound, hit, listening, rate)
    return sound


def ringing_seconds(solid: SoundingSolid) -> float:
    """Time until the slowest mode has decayed by 60 dB, at most `LONGEST_SECONDS`."""
    slowest = float(solid.dampings.min())
    return min(LONGEST_SECONDS, DECAY_NEPERS / slowest) if slowest > 0.0 else LONGEST_SECONDS


def _add_residual(sound: Array, hit: Hit, listening: Listening, rate: int) -> None:
    residual = listening.residual(hit.position, rate)
    begin = round(hit.seconds * rate)
    part = residual[: max(0, len(sound) - begin)]
    sound[begin : begin + len(part)] += np.linalg.norm(hit.impulse) * part
