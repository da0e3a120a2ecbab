"""Loudness of a body's modes, the click of its acceleration, and the noise of a design's clips.

The field of the click of a solid that is accelerated as a whole is that of a rigid sphere of the
same volume.  A sphere of radius a with the acceleration A radiates far away, at the angle theta to
A and a distance r, after the time (r - a) / c,

    P(s) / A(s) = rho a^3 cos(theta) / (c r)  s / (2 + 2 tau s + tau^2 s^2),  tau = a / c

(Koss and Alfredson 1973; Chadwick, Zheng and James 2012, Precomputed acceleration noise for
improved rigid-body sound).  It is order 1 of spherical harmonics: h_1(x) = -exp(ix) (x + i) / x^2
has the derivative -i exp(ix) (x^2 + 2 i x - 2) / x^3, and with s = -i omega and x = ka = i tau s
the pressure rho c v / (k r |h_1'(ka)|) of a sphere that moves at v = A / s becomes the one above.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve, lfilter

from carillon.arrays import Array
from sound.radiation.air import AIR_DENSITY, SOUND_SPEED
from sound.radiation.directivity import Directivity
from sound.radiation.modes_directivity import modes_directivity
from sound.radiation.sphere import radiated, sphere_directivity
from sound.scenes.audible.excitation import mean_places
from sound.scenes.bodies import Body
from sound.scenes.contact.impacts import HertzImpact
from sound.scenes.performance import Voice
from sound.scenes.scene import RadiationMethod
from sound.synthesis.driven import pulse

MATCHED_HERTZ = 10_000.0
"""Frequency [Hz] at which the filter has the magnitude of the sphere's response; a quarter of the
sampling rate if that is less."""


def mode_directivity(body: Body, radiation: RadiationMethod) -> Directivity:
    """Directivity [Pa m] of a body's modes per amplitude, at 0 dB.

    Each mode of a body without clips is as loud as its surface moves the air.  The modes of a
    design are as loud beside each other as its clips say, alike in all directions; together they
    are as loud as their surface moves the air, on average over the targets' points.  Those of a
    design for a place move the air with all phases, as the place was chosen by.  Without
    `radiation` all are 1, or what they are at that place.  Raises UserError if boundary elements
    are not installed.
    """
    assert body.solid is not None
    frequencies, shape = body.solid.frequencies, body.shape
    listening = body.listening
    of_place = None if listening is None else listening.heard
    if not radiation:
        alone = np.ones(len(frequencies)) if of_place is None else np.abs(of_place)
        return Directivity.uniform(alone)
    if radiation == "boundary-elements":
        air = modes_directivity(body.entry.name, shape, body.motion, frequencies)
    elif of_place is not None:
        air = sphere_directivity(body.motion, shape, frequencies)
    else:
        air = radiated(body.motion(shape.vertices), shape, frequencies).directivity
    if not body.is_as_clips:
        return air
    return Directivity.uniform(np.full(len(frequencies), _clip_factor(body, air)))


def voice(body: Body, directivity: Directivity) -> Voice:
    """The sound of a body struck by hand, from the directivity of its modes [full scale m]."""
    assert body.solid is not None
    shape = body.shape
    pushed = np.einsum("vik,vi->vk", body.motion(shape.vertices), shape.inward)
    struck = np.abs(pushed) * body.gains(shape.vertices)
    return Voice(body.solid.frequencies, body.solid.dampings, struck * directivity.rms)


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


def noise_gain(body: Body, directivity: Directivity) -> float:
    """Gain [Pa m] of the noise of a design's clips, from the directivity of its modes."""
    assert body.listening is not None
    if body.is_as_clips:
        return float(directivity.coefficients[0, 0].real)
    # At the place where the modes are heard as its clips are.
    return float(10.0 ** (body.entry.level / 20.0) / body.listening.gains.mean())


def _clip_factor(body: Body, air: Directivity) -> float:
    """Factor that gives a design's modes the energy with which its surface moves the air."""
    assert body.solid is not None and body.listening is not None
    solid, listening = body.solid, body.listening
    places = body.in_solid(body.shape.vertices)
    near = [int(np.argmin(np.linalg.norm(places - at, axis=1))) for at in listening.positions]
    inward = body.along_solid(body.shape.inward[near])
    amplitudes = solid.amplitudes(listening.positions, inward)
    ringing = amplitudes**2 / np.maximum(solid.dampings, 1e-3)
    own = (ringing * air.rms**2).sum()
    clips = (ringing * listening.gains[:, None] ** 2).sum()
    return float(np.sqrt(own / clips)) if clips > 0.0 else 1.0


def equivalent_radius(volume: float) -> float:
    """Radius [m] of the sphere that has this volume [m^3].

    Examples
    --------
    >>> round(equivalent_radius(4.0 / 3.0 * np.pi * 0.05**3), 6)
    0.05
    """
    return float(np.cbrt(3.0 * volume / (4.0 * np.pi)))


def acceleration_filter(radius: float, rate: int) -> tuple[Array, Array]:
    """Digital filter b, a (3,) [Pa m / (m/s^2)] from acceleration to the dipole of the click.

    The output for an acceleration (s, 3), times the unit vector to a listener and over the distance
    [m], is the pressure there, without the delay of the way.  The sphere has a radius [m], the rate
    is in Hz.

    Its poles are those of the sphere, -(1 +- i) / tau, at exp(pole / rate).  Of its two zeros one
    is at 0 Hz.  The other one and the gain make it exact towards 0 Hz and as loud as the sphere at
    `MATCHED_HERTZ` (as M. Vicanek, Matched second order digital filters, 2016, does for others).
    At 44.1 kHz it is at most 0.06 dB off from 0 to 10 kHz, whatever the radius.  The bilinear
    transform is up to 1.7 dB off there, or 1.0 dB when it is prewarped; the impulse-invariant one
    lets steady acceleration through, which is 35 dB too loud at 20 Hz for a radius of 1 cm.
    """
    ratio = SOUND_SPEED / (radius * rate)
    denominator = np.array([1.0, -2.0 * np.exp(-ratio) * np.cos(ratio), np.exp(-2.0 * ratio)])
    hertz = min(MATCHED_HERTZ, rate / 4.0)
    delay = np.exp(-2j * np.pi * hertz / rate)
    level = abs(
        sphere_response(radius, hertz) * np.polyval(denominator[::-1], delay) / (1.0 - delay)
    )
    # The numerator is (1 - 1/z) (g0 + g1/z), with the sum of g0 and g1 from 0 Hz.
    total = AIR_DENSITY * radius**3 / (2.0 * SOUND_SPEED) * rate * denominator.sum()
    product = (total**2 - level**2) / (2.0 * (1.0 - delay.real))
    first = (total + np.sqrt(total**2 - 4.0 * product)) / 2.0
    second = total - first
    return np.array([first, second - first, -second]), denominator


def sphere_response(radius: float, hertz: float | Array) -> np.complex128 | NDArray[np.complex128]:
    """P r / (A cos(theta)) [Pa m / (m/s^2)] of a sphere at frequencies [Hz], exp(i omega t)."""
    time = radius / SOUND_SPEED
    s = 2j * np.pi * np.asarray(hertz)
    return AIR_DENSITY * radius**3 / SOUND_SPEED * s / (2.0 + 2.0 * time * s + (time * s) ** 2)
