"""Sound of a moving body at the two ears of a head.

Each ear hears the body with the delay of the way, as 1 / distance, and through the shadow of a
spherical head (Brown and Duda, IEEE Transactions on Speech and Audio Processing 6, 1998): a filter
of one pole and one zero, and a longer way around the head.  Delays that change make Doppler's
shift.
"""

from dataclasses import dataclass

import numba
import numpy as np

from carillon.arrays import Array
from sound.radiation.air import SOUND_SPEED
from sound.scenes.performance import Motion

HEAD_RADIUS = 0.0875
"""Radius [m] of an average head."""
NEAREST = 0.1
"""Distance [m] below which loudness stays constant."""
ROUNDS = 4
"""Number of fixed-point iterations for the time of emission; each reduces the error by v / c."""
SIXTH = 1.0 / 6.0
UP = np.array([0.0, 0.0, 1.0])
SHADOW_LEAST, SHADOW_DEGREES = 0.1, 150.0
"""Least gain of high frequencies over all angles of incidence, and the angle that it is at."""


@dataclass(frozen=True)
class Head:
    """A head that may move: at ascending `times` (t,) [s] its centre is at `positions` (t, 3) [m],
    and its nose points to `facing` (3,) [m].
    """

    times: Array
    positions: Array
    facing: Array

    def at(self, times: Array) -> tuple[Array, Array]:
        """Positions (s, 3) [m] and directions to the right (s, 3) at times (s,) [s]."""
        places = self.places(times)
        ahead = self.facing - places
        right = np.cross(ahead, UP)
        length = np.linalg.norm(right, axis=1, keepdims=True)
        right = np.where(length > 1e-9, right, np.array([1.0, 0.0, 0.0]))
        return places, right / np.linalg.norm(right, axis=1, keepdims=True)

    def places(self, times: Array) -> Array:
        """Positions (s, 3) [m] at times (s,) [s]."""
        return np.stack([np.interp(times, self.times, each) for each in self.positions.T], axis=1)

    def axes(self, times: Array) -> Array:
        """Unit vectors (s, 3, 3) ahead, to the left and up at times (s,) [s]."""
        places, right = self.at(times)
        ahead = self.facing - places
        # Across the right, also where the nose points straight up or at the head itself.
        ahead = ahead - np.einsum("si,si->s", ahead, right)[:, None] * right
        length = np.linalg.norm(ahead, axis=1, keepdims=True)
        ahead = np.where(length > 1e-9, ahead / np.maximum(length, 1e-9), np.cross(UP, right))
        return np.stack([ahead, -right, np.cross(right, ahead)], axis=1)


def towards(motion: Motion, body: int, head: Head) -> Array:
    """Unit vectors (T, 3) in the scene from a body to the head, at the times of the motion."""
    places, _ = head.at(motion.times)
    away = places - motion.positions[:, body]
    return np.asarray(away / np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9))


def heard(source: Array, motion: Motion, body: int, head: Head, rate: int) -> Array:
    """Sound (s, 2) [Pa] of the body of a number at the left and the right ear of a head.

    The source (s,) [Pa m] is pressure times distance, in the direction of the head, at a rate [Hz].
    """
    times = motion.times
    places, right = head.at(times)
    away = seen_away(motion, body, places)
    distance = np.maximum(np.linalg.norm(away, axis=1), NEAREST)
    lateral = np.clip(np.einsum("ti,ti->t", away, right) / distance, -1.0, 1.0)
    ears = np.zeros((len(source), 2))
    for ear, side in enumerate((-1.0, 1.0)):
        angle = np.arccos(np.clip(side * lateral, -1.0, 1.0))
        delays = rate * (distance + _around(angle)) / SOUND_SPEED
        arriving = delayed(source, rate * times, delays, 1.0 / distance)
        ears[:, ear] = _shadowed(arriving, rate * times, _shadow(angle), rate)
    return ears


@numba.njit(cache=True, nogil=True)
def along(parts, frames, directions):  # type: ignore[no-untyped-def]
    """Components of vectors (s, 3) along directions (t, 3) that are linear between frames (t,)."""
    total = np.zeros(len(parts))
    last = len(frames) - 1
    begin = 0
    for frame in range(len(frames)):
        end = min(len(parts), int(np.ceil(frames[frame + 1]))) if frame < last else len(parts)
        length = frames[frame + 1] - frames[frame] if frame < last else 1.0
        then = min(frame + 1, last)
        for i in range(3):
            here = directions[frame, i]
            turn = (directions[then, i] - here) / length
            for n in range(begin, end):
                total[n] += parts[n, i] * (here + (n - frames[frame]) * turn)
        begin = max(begin, end)
    return total


def seen_away(motion: Motion, body: int, places: Array) -> Array:
    """Vectors (t, 3) [m] from a head to where a body emitted the sound that arrives then."""
    track = motion.positions[:, body]
    away = track - places
    for _ in range(ROUNDS):
        sounded = motion.times - np.linalg.norm(away, axis=1) / SOUND_SPEED
        then = [np.interp(sounded, motion.times, each) for each in track.T]
        away = np.stack(then, axis=1) - places
    return np.asarray(away)


def _around(angle: Array) -> Array:
    """Way [m] to an ear less that to the head's centre, by the angle between ear and source.

    Woodworth's formula: straight to a visible ear, around the head to a hidden one.
    """
    bent = angle - np.pi / 2.0
    return np.asarray(HEAD_RADIUS * np.where(bent < 0.0, -np.cos(angle), bent))


def _shadow(angle: Array) -> Array:
    """Gain of high frequencies, by the angle between ear and source."""
    half = SHADOW_LEAST / 2.0
    degrees = np.degrees(angle)
    return (1.0 + half) + (1.0 - half) * np.cos(np.radians(180.0 * degrees / SHADOW_DEGREES))


@numba.njit(cache=True, nogil=True)
def delayed(source, frames, delays, gains):  # type: ignore[no-untyped-def]
    """A source (s,) with delays [samples] and gains that are linear from frame to frame (t,)."""
    count = len(source)
    heard = np.zeros(count)
    last = len(frames) - 1
    begin = 0
    for frame in range(len(frames)):
        # After the last frame its values hold.
        end = min(count, int(np.ceil(frames[frame + 1]))) if frame < last else count
        length = frames[frame + 1] - frames[frame] if frame < last else 1.0
        then = min(frame + 1, last)
        slower = (delays[then] - delays[frame]) / length
        louder = (gains[then] - gains[frame]) / length
        for n in range(begin, end):
            since = n - frames[frame]
            place = n - (delays[frame] + since * slower)
            heard[n] = (gains[frame] + since * louder) * _between(source, place)
        begin = max(begin, end)
    return heard


@numba.njit(cache=True, nogil=True)
def _shadowed(arriving, frames, shadows, rate):  # type: ignore[no-untyped-def]
    """A sound (s,) through head shadows that are linear from frame to frame (t,)."""
    count = len(arriving)
    heard = np.zeros(count)
    # (1 + shadow s / (2 w)) / (1 + s / (2 w)), w = c / a, by the bilinear transformation.
    corner = 2.0 * SOUND_SPEED / HEAD_RADIUS
    ratio = 2.0 * rate / corner
    pole, scale = (1.0 - ratio) / (1.0 + ratio), 1.0 / (1.0 + ratio)
    before_in, before_out = 0.0, 0.0
    last = len(frames) - 1
    begin = 0
    for frame in range(len(frames)):
        end = min(count, int(np.ceil(frames[frame + 1]))) if frame < last else count
        length = frames[frame + 1] - frames[frame] if frame < last else 1.0
        brighter = (shadows[min(frame + 1, last)] - shadows[frame]) / length
        for n in range(begin, end):
            value = arriving[n]
            zero = (shadows[frame] + (n - frames[frame]) * brighter) * ratio
            out = scale * ((1.0 + zero) * value + (1.0 - zero) * before_in) - pole * before_out
            before_in, before_out = value, out
            heard[n] = out
        begin = max(begin, end)
    return heard


@numba.njit(cache=True, nogil=True)
def _between(source, place):  # type: ignore[no-untyped-def]
    """The source between samples, by Lagrange's cubic through four; 0 beyond its ends."""
    whole = int(np.floor(place))
    d = place - whole
    before, after, beyond = d + 1.0, d - 1.0, d - 2.0
    first = -SIXTH * d * after * beyond
    second = 0.5 * before * after * beyond
    third = -0.5 * before * d * beyond
    fourth = SIXTH * before * d * after
    if 1 <= whole < len(source) - 2:
        return (
            first * source[whole - 1]
            + second * source[whole]
            + third * source[whole + 1]
            + fourth * source[whole + 2]
        )
    total = 0.0
    for n, weight in ((whole - 1, first), (whole, second), (whole + 1, third), (whole + 2, fourth)):
        if 0 <= n < len(source):
            total += weight * source[n]
    return total
