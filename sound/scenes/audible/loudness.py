"""How loud each mode of a body is heard, and its click."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve, lfilter

from sound.scenes.audible.acceleration_noise import acceleration_filter, equivalent_radius
from sound.scenes.audible.excitation import middle_places
from sound.scenes.audible.radiation import Radiation, radiated
from sound.scenes.audible.ringing import pulse
from sound.scenes.bodies import Body
from sound.scenes.contact.impacts import Blow
from sound.scenes.performance import Voice

Array = NDArray[np.float64]

CHANNELS = 4
"""What a body sounds in all directions, and how much more towards its own x, y and z."""


def mode_gains(body: Body, radiation: bool) -> Array:
    """Pressure times distance (K, CHANNELS) [Pa m] of the amplitudes of a body's modes, at 0 dB.

    Of modes without clips each is as loud as its surface moves the air.  The modes of a design are
    as loud beside each other as its clips say; together they are as loud as their surface moves the
    air, in the mean over the targets' points.

    Parameters
    ----------
    radiation : bool
        Without, gains are 1: amplitudes are heard as they are.
    """
    assert body.solid is not None
    gains = np.zeros((len(body.solid.frequencies), CHANNELS))
    gains[:, 0] = 1.0
    if radiation:
        found = _radiation(body)
        if body.listening is None:
            gains = np.column_stack([found.monopoles, found.dipoles])
        else:
            gains *= _as_loud(body, found)
    return gains


def voice(body: Body, gains: Array) -> Voice:
    """What a body sounds like when struck by hand, by the gains of its modes [full scale m]."""
    assert body.solid is not None
    shape = body.shape
    pushed = np.einsum("vik,vi->vk", body.motion(shape.vertices), shape.inward)
    struck = np.abs(pushed)
    if body.listening is not None:
        places = body.in_solid(shape.vertices)
        struck *= np.array([[body.listening.gain(place)] for place in places])
    loud = np.sqrt(gains[:, 0] ** 2 + (gains[:, 1:] ** 2).sum(axis=1) / 3.0)
    return Voice(body.solid.frequencies, body.solid.dampings, struck * loud)


def click(number: int, body: Body, blows: list[Blow], count: int, rate: int) -> Array:
    """Pressure times distance (count, 3) [Pa m] towards the scene's x, y and z, as a body jerks.

    As of a rigid sphere of its volume, by the blows that it takes part in.  The clips of a design
    have such clicks already.
    """
    jerked = np.zeros((count, 3))
    if body.entry.fixed or body.listening is not None:
        return jerked
    for blow in blows:
        impact = blow.impact
        begin = round(impact.seconds * rate)
        if begin >= count:
            break
        sign = 1.0 if impact.pair[0] == number else -1.0
        jerk = rate * pulse(impact.duration, rate)[: count - begin]
        change = sign * impact.impulse / body.mass
        jerked[begin : begin + len(jerk)] += jerk[:, None] * change
    b, a = acceleration_filter(equivalent_radius(body.volume), rate)
    return np.asarray(lfilter(b, a, jerked, axis=0)) * 10.0 ** (body.entry.level / 20.0)


def clip_noise(
    number: int, body: Body, blows: list[Blow], gain: float, count: int, rate: int
) -> Array:
    """What the clips of a design hold besides modes (count,), in proportion to the impulses.

    As `sound.rendering.render` has it, times a `gain` of the modes that go with it [Pa m].
    """
    assert body.listening is not None
    noises = body.listening.noise(rate)
    strikes = np.zeros((len(noises), count))
    for blow in blows:
        begin = round(blow.impact.seconds * rate)
        if begin >= count:
            break
        side = blow.impact.pair.index(number)
        impulses = blow.impulses[:, side]
        middle = body.in_solid(middle_places(blow.places[:, side], impulses, np.array([0])))[0]
        strength = float(np.linalg.norm(impulses.sum(axis=0)))
        strikes[:, begin] += strength * body.listening.weights(middle)
    total = np.zeros(count)
    for struck, noise in zip(strikes, noises):
        if struck.any() and len(noise):
            total += gain * fftconvolve(struck, noise)[:count]
    return total


def _radiation(body: Body) -> Radiation:
    assert body.solid is not None
    return radiated(body.motion(body.shape.vertices), body.shape, body.solid.frequencies)


def _as_loud(body: Body, found: Radiation) -> float:
    """Factor that lets a design's modes have the energy with which its surface moves the air."""
    assert body.solid is not None and body.listening is not None
    solid, listening = body.solid, body.listening
    places = body.in_solid(body.shape.vertices)
    near = [int(np.argmin(np.linalg.norm(places - at, axis=1))) for at in listening.positions]
    inward = body.along_solid(body.shape.inward[near])
    amplitudes = solid.amplitudes(listening.positions, inward)
    moved = found.monopoles**2 + (found.dipoles**2).sum(axis=1) / 3.0
    ringing = amplitudes**2 / np.maximum(solid.dampings, 1e-3)
    own = (ringing * moved).sum()
    clips = (ringing * listening.gains[:, None] ** 2).sum()
    return float(np.sqrt(own / clips)) if clips > 0.0 else 1.0
