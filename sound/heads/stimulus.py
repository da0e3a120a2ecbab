"""What a listener compares heads by: a sound from a direction at the two ears of a head."""

from __future__ import annotations

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from carillon.arrays import Array
from sound.heads.measured_head import MeasuredHead, filters_of

DIRECTIONS = (
    (0.0, 0.0),
    (180.0, 0.0),
    (0.0, 45.0),
    (-60.0, 0.0),
    (150.0, 30.0),
    (0.0, -30.0),
    (60.0, 45.0),
    (-120.0, 0.0),
    (0.0, 90.0),
)
"""Azimuths, positive to the left, and elevations [degrees] that comparisons go through in turn.
Most lie in the plane between the ears, or mirror each other ahead and behind: these the ears tell
apart by the shape of a spectrum alone.  Nine of them meet each of the four pairs of a generation.
"""
BURSTS, BURST_SECONDS, PAUSE_SECONDS = 3, 0.25, 0.15
"""Number and length of the bursts of noise, and of the silence between them."""
FADE_SECONDS = 0.01
"""Time in which a burst comes and goes."""
LEAD_SECONDS = 0.002
"""Time by which all is late, so that an ear that is nearer than the centre of the head has its
sound in time too."""


def direction_of(number: int) -> Array:
    """Unit vector (3,) ahead, left, up of the direction of a comparison, counted from 0."""
    azimuth, elevation = np.radians(DIRECTIONS[number % len(DIRECTIONS)])
    level = np.cos(elevation)
    return np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])


def noise_bursts(rate: float, seed: int) -> Array:
    """Samples (s,) of bursts of white noise, which has all frequencies that ears tell apart."""
    length, pause = round(BURST_SECONDS * rate), round(PAUSE_SECONDS * rate)
    noise = np.random.default_rng(seed).standard_normal((BURSTS, length))
    ramp = np.sin(np.linspace(0.0, np.pi / 2.0, round(FADE_SECONDS * rate))) ** 2
    noise[:, : len(ramp)] *= ramp
    noise[:, -len(ramp) :] *= ramp[::-1]
    return np.pad(noise, ((0, 0), (0, pause))).ravel()[:-pause]


def at_ears(head: MeasuredHead, direction: Array, source: Array) -> Array:
    """Samples (t, 2) at the left and the right ear of a head of a source (s,).

    The source has the rate of the head and is far away, in a direction (3,): a unit vector ahead,
    left, up.  Filters and delays are interpolated between those measured, as scenes do.
    """
    corners, weights, _ = head.mesh.weights(direction[None])
    filters = np.tensordot(weights[0], filters_of(head.log_magnitudes[corners[0]]), 1)
    late = LEAD_SECONDS + weights[0] @ head.delays[corners[0]]
    length = len(source) + filters.shape[1] + round(2.0 * LEAD_SECONDS * head.rate)
    count = next_fast_len(length, real=True)
    frequencies = np.arange(count // 2 + 1) * head.rate / count
    heard = rfft(filters, count) * rfft(source, count)
    heard *= np.exp(-2j * np.pi * frequencies * late[:, None])
    return np.asarray(irfft(heard, count)[:, :length].T)
