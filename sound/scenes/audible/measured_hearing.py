"""Sound of a moving body at the two ears of a measured head.

The delay of the way, 1 / distance and Doppler's shift are as by a spherical head; what an ear adds
by direction is a filter and a delay of the measurement.  Filters change from block to block: each
block of the arriving sound fades in and out, and goes through the filter of its middle.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, next_fast_len, rfft

from carillon.arrays import Array
from sound.heads.measured_head import MeasuredHead
from sound.radiation.air import SOUND_SPEED
from sound.scenes.audible.hearing import NEAREST, Head, delayed, seen_away
from sound.scenes.performance import Motion

HOP = 128
"""Samples from the middle of a block to that of the next one; a block is twice as long."""
SAMPLED = 200
"""Number of times, at most, at which it is asked whether directions were measured."""
AT_ONCE = 256
"""Number of blocks that are filtered at once."""


def heard_measured(
    source: Array, motion: Motion, body: int, head: Head, measured: MeasuredHead, rate: int
) -> Array:
    """Sound (s, 2) [Pa] of the body of a number at the left and the right ear of a measured head.

    The source (s,) [Pa m] is pressure times distance, in the direction of the head, at a rate [Hz]
    that is also that of the measured head.
    """
    times = motion.times
    away = seen_away(motion, body, head.places(times))
    distance = np.maximum(np.linalg.norm(away, axis=1), NEAREST)
    middles = np.arange(-(-len(source) // HOP) + 1) * (HOP / rate)
    corners, weights, _ = measured.mesh.weights(_directions(motion, away, head, middles))
    onsets = np.einsum("bk,bke->eb", weights, measured.delays[corners])
    ears = np.zeros((len(source), 2))
    for ear in range(2):
        way = distance / SOUND_SPEED + np.interp(times, middles, onsets[ear])
        arriving = delayed(source, rate * times, rate * way, 1.0 / distance)
        ears[:, ear] = filtered(arriving, measured.filters[:, ear], corners, weights)
    return ears


def unmeasured_share(motion: Motion, head: Head, measured: MeasuredHead) -> float:
    """Share of the directions from the head to bodies that it was not measured in, from 0 to 1, at
    some times of the motion.
    """
    times = motion.times[:: -(-len(motion.times) // SAMPLED)]
    places = head.places(motion.times)
    unmeasured = []
    for body in range(motion.positions.shape[1]):
        directions = _directions(motion, motion.positions[:, body] - places, head, times)
        unmeasured.append(measured.mesh.weights(directions)[2])
    return float(np.mean(unmeasured))


def filtered(sound: Array, filters: Array, corners: NDArray[np.intp], weights: Array) -> Array:
    """Sound (s,) through filters that change from block to block.

    Block b has its middle at sample b HOP and goes through the filters (M, L) of numbers `corners`
    (b, 3), added up with `weights` (b, 3).  Its window is cos^2, so that all windows add up to 1.
    """
    blocks, length = len(corners), filters.shape[1]
    window = np.sin(np.pi * (np.arange(2 * HOP) + 0.5) / (2 * HOP)) ** 2
    padded = np.zeros((blocks + 1) * HOP)
    padded[HOP : HOP + len(sound)] = sound
    count = next_fast_len(2 * HOP + length - 1, real=True)
    heard = np.zeros(blocks * HOP + HOP + count)
    for first in range(0, blocks, AT_ONCE):
        numbers = np.arange(first, min(first + AT_ONCE, blocks))
        parts = padded[(numbers * HOP)[:, None] + np.arange(2 * HOP)] * window
        mixed = np.einsum("bk,bkl->bl", weights[numbers], filters[corners[numbers]])
        through = irfft(rfft(parts, count) * rfft(mixed, count), count)
        for number, part in zip(numbers, through):
            heard[number * HOP : number * HOP + count] += part
    return heard[HOP : HOP + len(sound)]


def _directions(motion: Motion, away: Array, head: Head, times: Array) -> Array:
    """Unit vectors (b, 3) along the axes of the head, at times (b,) [s], of vectors (t, 3) [m] from
    it at the times of the motion.
    """
    there = np.stack([np.interp(times, motion.times, each) for each in away.T], axis=1)
    turned = np.einsum("bai,bi->ba", head.axes(times), there)
    length = np.linalg.norm(turned, axis=1, keepdims=True)
    # A body in the middle of the head is heard from ahead.
    turned = np.where(length > 1e-9, turned, np.array([1.0, 0.0, 0.0]))
    return np.asarray(turned / np.linalg.norm(turned, axis=1, keepdims=True))
