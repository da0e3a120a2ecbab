"""A scene that was played: what is seen, what is heard, and what struck what."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sound.scenes.picture import Picture

Array = NDArray[np.float64]

GROUND = -1
"""Number of the ground among the objects."""


class Impact(NamedTuple):
    """Two solids that strike each other.

    Attributes
    ----------
    seconds : float [s]
        When it begins.
    pair : (2,)
        Numbers of the objects, `GROUND` for the ground, which is the second one then.
    position : (3,) [m]
        Where, in the scene.
    impulse : (3,) [N s]
        On the first object; the second one receives its negative.
    speed : float [m/s]
        At which they approach each other.
    duration : float [s]
        Of the contact, by Hertz.
    """

    seconds: float
    pair: tuple[int, int]
    position: Array
    impulse: Array
    speed: float
    duration: float


@dataclass(frozen=True)
class Voice:
    """What an object sounds like when it is struck by hand.

    Attributes
    ----------
    frequencies : (N,) [Hz]
        Of its modes.
    dampings : (N,) [1/s]
        Amplitudes fall as exp(-d t).
    gains : (V, N) [full scale]
        What 1 N s inwards at each vertex of its surface lets the modes sound with, one metre away
        and as loud as in the scene's sound.
    """

    frequencies: Array
    dampings: Array
    gains: Array


@dataclass(frozen=True)
class Performance:
    """A scene from its beginning to its end.

    Attributes
    ----------
    title
        Of the scene.
    picture
        What is seen.
    sound : (s, 2) [full scale]
        What the two ears hear.
    rate : int [Hz]
        Its samples per second.
    impacts
        In the order of time; rolling and sliding are none.
    voices : B voices
        None for an object that does not sound.
    scale : float [1/Pa]
        Full scale per pascal.
    timings : dict [s]
        Wall time by what was done.
    accuracies : B dicts
        How far each object's frequencies are expected to be from the solid's, see
        `sound.scenes.uniform.UniformSolid`; None for one that does not sound, or if nothing is
        known of it.
    moved : dict
        How far (3,) [m] objects that overlapped were moved before the start, by their names.
    """

    title: str
    picture: Picture
    sound: Array
    rate: int
    impacts: list[Impact]
    voices: list[Voice | None]
    scale: float = 1.0
    timings: dict[str, float] = field(default_factory=dict)
    accuracies: list[dict[str, Any] | None] = field(default_factory=list)
    moved: dict[str, list[float]] = field(default_factory=dict)
