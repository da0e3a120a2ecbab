"""Samples of strikes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from carillon.arrays import Array
from solver.response.response import SAMPLE_RATE_HERTZ, half_sine
from sound.rendering.listening import Listening
from sound.rendering.solid import SoundingSolid
from sound.synthesis.sinusoids import Bank, ring


@dataclass(frozen=True)
class Hit:
    """A strike at a time [s], at a point (3,) [m] of the surface, by an impulse (3,) [N s].

    `distance` [m] is that of the point from the one that was named.
    """

    seconds: float
    position: Array
    impulse: Array
    distance: float = 0.0


def render(*given: Any, **named: Any) -> Array:
    """The sound (s,) of one strike or many: the sum of `rendered_parts`, with its parameters."""
    return np.add(*rendered_parts(*given, **named))


def rendered_parts(
    solid: SoundingSolid,
    hits: Sequence[Hit],
    seconds: float,
    rate: int = SAMPLE_RATE_HERTZ,
    contact_seconds: float = 0.0,
    listening: Listening | None = None,
    residual: bool = True,
) -> tuple[Array, Array]:
    """Sound (s,) of the modes after one strike or many, and noise (s,) of the clips.

    Parameters
    ----------
    seconds, rate : float [s], int [Hz]
        Length, and samples per second; modes from half of these on are left out.
    contact_seconds : float [s]
        Duration of the force, half a sine; 0 is an impulse.  A longer force excites high modes
        less.  The noise, which is recorded, does not depend on it.
    listening
        Loudness and noise of a design's clips: full scale is then the clips', and noise is
        proportional to the impulse over 1 N s.  Without it samples are sums of the modes'
        amplitudes [kg^-1/2 N s], and there is no noise.
    residual : bool
        Whether there is noise.
    """
    count = round(seconds * rate)
    positions = np.array([hit.position for hit in hits])
    amplitudes = solid.amplitudes(positions, np.array([hit.impulse for hit in hits]))
    if listening is not None:
        amplitudes *= np.array([[listening.gain(position)] for position in positions])
    bank = Bank(solid.frequencies, solid.dampings, rate)
    modes = ring(bank, zip([hit.seconds for hit in hits], amplitudes), count)
    if contact_seconds > 0.0:
        from scipy.signal import fftconvolve  # Slow to load.

        modes = fftconvolve(modes, half_sine(contact_seconds, rate))[:count]
    noise = np.zeros(count)
    if listening is not None and residual:
        noises = listening.noise(rate)
        for hit in hits:
            begin, strength = round(hit.seconds * rate), np.linalg.norm(hit.impulse)
            for weight, own in zip(listening.weights(hit.position), noises):
                part = own[: max(0, count - begin)] if weight > 0.0 else own[:0]
                noise[begin : begin + len(part)] += weight * strength * part
    return modes, noise


def residual_share(modes: Array, noise: Array) -> float:
    """Share of the noise in a sound's energy; 0 of silence."""
    own, other = float(noise @ noise), float(modes @ modes)
    return own / (own + other) if own > 0.0 else 0.0
