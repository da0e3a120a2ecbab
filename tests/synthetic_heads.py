"""Heads that are made, not measured, for tests: a sphere with pinnae, told by a few numbers.

The sphere shadows and delays as the head of `sound.scenes.audible.hearing`; each pinna has a
resonance and two notches whose frequencies rise with elevation, and is dull from behind.
"""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from carillon.arrays import Array
from sound.heads.minimum_phase import minimum_phase
from sound.heads.sofa_file import MeasuredResponses, write_sofa
from sound.radiation.air import SOUND_SPEED
from sound.scenes.audible.hearing import SHADOW_DEGREES, SHADOW_LEAST

RATE, SAMPLES = 44_100, 256
GRID = 2048
DETAILS = 24
"""Number of patterns over frequency and direction that tell two heads of equal numbers apart."""
DETAIL_SEED = 1
EARS = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True)
class Anatomy:
    """What a head is told by."""

    radius: float = 0.0875
    """Radius of the sphere [m]."""
    scale: float = 1.0
    """Size of the pinnae over the usual one; frequencies fall with it."""
    notch: float = 7000.0
    """Frequency of the first notch from ahead [Hz]."""
    rise: float = 0.5
    """Octaves by which notches rise from the horizon to the zenith."""
    depth: float = 15.0
    """Depth of the notches [dB]."""
    second: float = 1.5
    """Frequency of the second notch over that of the first."""
    resonance: float = 4200.0
    """Frequency of the resonance [Hz]."""
    gain: float = 10.0
    """Gain of the resonance [dB]."""
    behind: float = 8.0
    """Loss of high frequencies from behind [dB]."""
    details: Array = field(default_factory=lambda: np.zeros(DETAILS))
    """Levels of further patterns (DETAILS,) [dB]."""


def drawn(random: np.random.Generator) -> Anatomy:
    """A head whose numbers vary about as those of people do: pinnae by 12 %, heads by 6 %."""
    normal = random.standard_normal(9)
    return Anatomy(
        0.0875 * np.exp(0.06 * normal[0]),
        np.exp(0.12 * normal[1]),
        7000.0 * np.exp(0.06 * normal[2]),
        0.5 + 0.12 * normal[3],
        float(np.clip(15.0 + 4.0 * normal[4], 3.0, 30.0)),
        1.5 + 0.08 * normal[5],
        4200.0 * np.exp(0.06 * normal[6]),
        10.0 + 2.0 * normal[7],
        8.0 + 2.5 * normal[8],
        random.standard_normal(DETAILS) * 1.2,
    )


def sphere_directions(elevations: tuple[float, float] = (-40.0, 90.0), step: float = 10.0) -> Array:
    """Unit vectors (M, 3) of rings between two elevations [degrees], about `step` degrees apart."""
    rings = []
    for elevation in np.radians(np.arange(elevations[0], elevations[1] + 1e-9, step)):
        count = max(1, round(2.0 * np.pi * np.cos(elevation) / np.radians(step)))
        azimuth = 2.0 * np.pi * np.arange(count) / count
        level = np.cos(elevation)
        around = level * np.cos(azimuth), level * np.sin(azimuth), np.full(count, np.sin(elevation))
        rings.append(np.stack(around, axis=1))
    return np.concatenate(rings)


def decibels_of(anatomy: Anatomy, directions: Array, frequencies: Array) -> Array:
    """Levels (M, 2, F) [dB] at both ears."""
    octaves = np.log2(np.maximum(frequencies, 20.0) * anatomy.scale)
    ahead, _, up = directions.T
    rise = anatomy.rise * np.arctan2(up, np.hypot(ahead, 0.3)) / (np.pi / 2.0)
    levels = np.empty((len(directions), 2, len(frequencies)))
    patterns = _patterns(directions, octaves)
    for ear, axis in enumerate(EARS):
        towards = directions @ axis
        angle = np.degrees(np.arccos(np.clip(towards, -1.0, 1.0)))
        half = SHADOW_LEAST / 2.0
        gain = 1.0 + half + (1.0 - half) * np.cos(np.radians(180.0 * angle / SHADOW_DEGREES))
        pole = 2.0 * np.pi * frequencies * anatomy.radius / (2.0 * SOUND_SPEED)
        shadow = np.abs((1.0 + 1j * gain[:, None] * pole) / (1.0 + 1j * pole))
        seen = (0.6 + 0.4 * towards)[:, None]
        first = np.log2(anatomy.notch) + rise[:, None]
        deep = anatomy.depth * seen * (0.7 + 0.3 * np.tanh(3.0 * ahead))[:, None]
        level = 20.0 * np.log10(shadow)
        level += anatomy.gain * seen * _bump(octaves, np.log2(anatomy.resonance), 0.5)
        level -= deep * _bump(octaves, first, 0.15)
        level -= 0.7 * deep * _bump(octaves, first + np.log2(anatomy.second), 0.12)
        high = 1.0 / (1.0 + np.exp(-(octaves - np.log2(6000.0)) / 0.3))
        level -= anatomy.behind * (0.5 - 0.5 * ahead)[:, None] * high
        level += np.tensordot(anatomy.details, patterns, 1)
        levels[:, ear] = level
    return levels


def _bump(octaves: Array, middle: Array | float, width: float) -> Array:
    return np.exp(-0.5 * ((octaves - middle) / width) ** 2)


def _patterns(directions: Array, octaves: Array) -> Array:
    """Smooth patterns (DETAILS, M, F), alike for all heads, of high frequencies alone."""
    random = np.random.default_rng(DETAIL_SEED)
    waves = random.normal(size=(DETAILS, 3)) * 1.5
    speeds, phases = random.uniform(1.0, 3.0, DETAILS), random.uniform(0.0, 2.0 * np.pi, DETAILS)
    across = waves @ directions.T
    high = 1.0 / (1.0 + np.exp(-(octaves - np.log2(3000.0)) / 0.3))
    along = 2.0 * np.pi * np.outer(speeds, octaves) / 3.0
    total = np.sin(across[:, :, None] + (along + phases[:, None])[:, None, :])
    return np.asarray(total * high / np.sqrt(DETAILS / 4.0))


def delays_of(anatomy: Anatomy, directions: Array) -> Array:
    """Delays (M, 2) [s] by Woodworth's formula."""
    angle = np.arccos(np.clip(directions @ EARS.T, -1.0, 1.0))
    bent = angle - np.pi / 2.0
    return np.asarray(anatomy.radius * np.where(bent < 0.0, -np.cos(angle), bent) / SOUND_SPEED)


def made_head(
    anatomy: Anatomy, directions: Array, title: str = "made", rate: float = RATE
) -> MeasuredResponses:
    """The impulse responses of a head, as a file has them: 1 ms of silence before the nearest."""
    frequencies = np.arange(GRID // 2 + 1) * rate / GRID
    levels = decibels_of(anatomy, directions, frequencies)
    plain = minimum_phase(levels * np.log(10.0) / 20.0)[:, :, :SAMPLES]
    delays = 1e-3 + delays_of(anatomy, directions)
    turned = np.exp(-2j * np.pi * frequencies * delays[:, :, None])
    turned[:, :, -1] = turned[:, :, -1].real
    responses = np.fft.irfft(np.fft.rfft(plain, GRID) * turned, GRID)[:, :, : 2 * SAMPLES]
    count = len(directions)
    return MeasuredResponses(
        title, rate, directions, np.full(count, 1.4), responses, np.zeros((count, 2))
    )


def write_head(path: Path, anatomy: Anatomy, directions: Array, rate: float = RATE) -> Path:
    """A SOFA file of a head."""
    write_sofa(path, made_head(anatomy, directions, path.stem, rate), path.stem, "made for a test")
    return path
