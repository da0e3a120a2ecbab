"""The result of playing a scene: motion, sound and impacts."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

from carillon.arrays import Array
from sound.scenes.picture import Picture

GROUND = -1
"""Number that stands for the ground in pairs of bodies."""


class Impact(NamedTuple):
    """An impact of two bodies.

    Attributes
    ----------
    seconds : float [s]
        Time at which it begins.
    pair : (2,)
        Numbers of the bodies; the ground, `GROUND`, is always the second one.
    position : (3,) [m]
        Position in the scene.
    impulse : (3,) [N s]
        Impulse on the first body; the second one receives its negative.
    speed : float [m/s]
        Speed of approach.
    duration : float [s]
        Duration of the contact, by Hertz.
    """

    seconds: float
    pair: tuple[int, int]
    position: Array
    impulse: Array
    speed: float
    duration: float


@dataclass(frozen=True)
class Voice:
    """The sound of an object that is struck by hand.

    Attributes
    ----------
    frequencies : (N,) [Hz]
        Frequencies of the modes.
    dampings : (N,) [1/s]
        Dampings d: amplitudes fall as exp(-d t).
    gains : (V, N) [full scale]
        Amplitudes of the modes one metre away after 1 N s inwards at each vertex of the surface,
        as loud as in the scene's sound.
    """

    frequencies: Array
    dampings: Array
    gains: Array


@dataclass(frozen=True)
class Performance:
    """A scene that was played.

    Attributes
    ----------
    title
        Title of the scene.
    picture
        Surfaces, motion and camera.
    sound : (s, 2) [full scale]
        Sound at the left and the right ear.
    rate : int [Hz]
        Samples per second.
    impacts
        Impacts in the order of time, without rolling and sliding.
    voices : B voices
        Sounds of the objects; None for a silent one.
    scale : float [1/Pa]
        Full scale per pascal.
    timings : dict [s]
        Wall time of each step of the work.
    accuracies : B dicts
        Expected errors of each object's frequencies, see `sound.scenes.uniform.UniformSolid`; None
        for a silent object, or if they are unknown.
    moved : dict
        Displacements (3,) [m] by which overlapping objects were separated before the start, by
        name.
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
