"""Loudness of a body's modes, the click of its acceleration, and the noise of a design's clips."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.signal import fftconvolve, lfilter

from carillon.arrays import Array
from sound.scenes.audible.acceleration_noise import acceleration_filter, equivalent_radius
from sound.scenes.audible.excitation import mean_places
from sound.scenes.audible.radiation import Radiation, radiated
from sound.scenes.body import Body
from sound.scenes.contact.impacts import HertzImpact
from sound.scenes.performance import Voice
from sound.synthesis.driven import pulse

CHANNELS = 4
"""Number of channels of a body: one equal in all directions, and one along each of its axes."""


def mode_gains(body: Body, radiation: bool) -> Array:
    """Pressure times distance (K, CHANNELS) [Pa m] per amplitude of a body's modes, at 0 dB.

    Each mode of a body without clips is as loud as its surface moves the air.  The modes of a
    design are as loud beside each other as its clips say; together they are as loud as their
    surface moves the air, on average over the targets' points.

    Parameters
    ----------
    radiation : bool
        Whether surfaces radiate; else gains are 1.
    """
    assert body.solid is not None
    gains = np.zeros((len(body.solid.frequencies), CHANNELS))
    gains[:, 0] = 1.0
    if radiation:
        air = radiated(body.motion(body.shape.vertices), body.shape, body.solid.frequencies)
        if body.listening is None:
            gains = np.column_stack([air.monopoles, air.dipoles])
        else:
            gains *= _clip_factor(body, air)
    return gains


def voice(body: Body, gains: Array) -> Voice:
    """The sound of a body struck by hand, from the gains of its modes [full scale m]."""
    assert body.solid is not None
    shape = body.shape
    pushed = np.einsum("vik,vi->vk", body.motion(shape.vertices), shape.inward)
    struck = np.abs(pushed) * body.gains(shape.vertices)
    loud = np.sqrt(gains[:, 0] ** 2 + (gains[:, 1:] ** 2).sum(axis=1) / 3.0)
    return Voice(body.solid.frequencies, body.solid.dampings, struck * loud)


def click(number: int, body: Body, impacts: Sequence[HertzImpact], count: int, rate: int) -> Array:
    """Pressure times distance (count, 3) [Pa m] along the scene's axes, by a body's acceleration.

    It is that of a rigid sphere of the body's volume.  The clips of a design contain such clicks
    already.
    """
    jerked = np.zeros((count, 3))
    if body.entry.fixed or body.listening is not None:
        return jerked
    for each in impacts:
        impact = each.impact
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
    number: int,
    body: Body,
    impacts: Sequence[HertzImpact],
    gain: float,
    count: int,
    rate: int,
) -> Array:
    """Noise (count,) of a design's clips, in proportion to the impulses and to a gain [Pa m].

    The gain is that of the modes; the proportions are those of `sound.rendering.render`.
    """
    assert body.listening is not None
    noises = body.listening.noise(rate)
    strikes = np.zeros((len(noises), count))
    for each in impacts:
        begin = round(each.impact.seconds * rate)
        if begin >= count:
            break
        side = each.impact.pair.index(number)
        impulses = each.impulses[:, side]
        middle = body.in_solid(mean_places(each.places[:, side], impulses, np.array([0])))[0]
        strength = float(np.linalg.norm(impulses.sum(axis=0)))
        strikes[:, begin] += strength * body.listening.weights(middle)
    total = np.zeros(count)
    for struck, noise in zip(strikes, noises):
        if struck.any() and len(noise):
            total += gain * fftconvolve(struck, noise)[:count]
    return total


def _clip_factor(body: Body, air: Radiation) -> float:
    """Factor that gives a design's modes the energy with which its surface moves the air."""
    assert body.solid is not None and body.listening is not None
    solid, listening = body.solid, body.listening
    places = body.in_solid(body.shape.vertices)
    near = [int(np.argmin(np.linalg.norm(places - at, axis=1))) for at in listening.positions]
    inward = body.along_solid(body.shape.inward[near])
    amplitudes = solid.amplitudes(listening.positions, inward)
    moved = air.monopoles**2 + (air.dipoles**2).sum(axis=1) / 3.0
    ringing = amplitudes**2 / np.maximum(solid.dampings, 1e-3)
    own = (ringing * moved).sum()
    clips = (ringing * listening.gains[:, None] ** 2).sum()
    return float(np.sqrt(own / clips)) if clips > 0.0 else 1.0
