"""How near a sound comes to a clip, and up to where it is like it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array
from sound.rendering.listening import Listening
from sound.rendering.render import Hit, render
from sound.rendering.solid import SoundingSolid
from sound.synthesis.spectral_distance import log_spectral_distance

LIKE_CENTS, LIKE_DECIBELS, LIKE_RATIO = 30.0, 12.0, 1.5
"""Median distance of the partials [cents], distance of the sounds [dB], and ratio of their times of
decay, up to which a design sounds like its clip."""
NEARER_DECIBELS = 6.0
"""Distance [dB] by which a design that is near its clip is nearer than silence."""


@dataclass(frozen=True)
class Likeness:
    """How near a design comes to one clip.

    `distance_db` and `silence_db` are distances of the design and of silence from the clip, see
    `log_spectral_distance`; `decay_ratio` is the time in which the design dies away over the
    clip's.
    """

    target: str
    distance_db: float
    silence_db: float
    decay_ratio: float

    @classmethod
    def of_strike(
        cls,
        name: str,
        position: Array,
        inward: Array,
        solid: SoundingSolid,
        listening: Listening,
        clip: Array,
        rate: int,
    ) -> Likeness:
        """Likeness of a strike at a point (3,) [m] along `inward` (3,), as loud as the clip (s,).

        Raises ValueError if the clip is silent.
        """
        sound = render(solid, [Hit(0.0, position, inward)], len(clip) / rate, rate, 0.0, listening)
        level = np.sqrt((clip @ clip) / max(float(sound @ sound), 1e-300))
        return cls(
            name,
            log_spectral_distance(level * sound, clip, rate),
            log_spectral_distance(np.zeros(1), clip, rate),
            decay_seconds(sound, rate) / decay_seconds(clip, rate),
        )

    @property
    def times(self) -> float:
        """How many times longer or shorter than the clip the design rings, 1 or more."""
        ratio = self.decay_ratio
        return max(ratio, 1.0 / ratio) if ratio > 0.0 else np.inf

    @property
    def excess(self) -> float:
        """Distance or ratio of decay over the limit of what is like, the greater of the two."""
        return max(self.distance_db / LIKE_DECIBELS, np.log(self.times) / np.log(LIKE_RATIO))


def furthest_decay(likeness: Sequence[Likeness]) -> Likeness:
    """The one whose decay is furthest from its clip's."""
    return max(likeness, key=lambda each: each.times)


def decay_seconds(sound: Array, rate: int) -> float:
    """Time [s] in which a sound falls by 60 dB, from the fall of what is left of its energy.

    By the slope between -3 and -25 dB (Schroeder's integration), or as far as the sound goes.

    Examples
    --------
    >>> t = np.arange(44100) / 44100
    >>> round(decay_seconds(np.exp(-6.9 * t) * np.sin(2e3 * t), 44100), 2)
    1.0
    """
    left = np.cumsum((sound**2)[::-1])[::-1]
    if not len(left) or left[0] <= 0.0:
        return 0.0
    level = 10.0 * np.log10(np.maximum(left / left[0], 1e-12))
    inside = np.flatnonzero((level <= -3.0) & (level >= -25.0))
    if len(inside) < 2:
        return len(sound) / rate
    slope = np.polyfit(inside / rate, level[inside], 1)[0]
    return float(-60.0 / slope)
