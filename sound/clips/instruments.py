"""Synthesised clips to design after: struck metal, struck wood and a piano's strings.

Only the common features of such sounds are modelled, after Fletcher and Rossing, The Physics of
Musical Instruments (1998): frequencies of the partials, their excitation by the place of the
strike, their decay, and the noise of the blow.

- Metal: bending modes (m, n) of a simply supported rectangular plate, whose frequencies grow as
  (m/a)^2 + (n/b)^2 (ch. 3), with the small loss of metals.
- Wood: bending modes of a free bar, whose frequencies grow as 3.011^2, 5^2, 7^2, ... (ch. 2), with
  the loss of wood, some fifty times as large, and a knock.
- Piano: partials n f sqrt(1 + B n^2) of a stiff string (ch. 12) struck at about an eighth of its
  length by a soft hammer.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError
from sound.clips.extraction import ModalSound

CONCERT_HERTZ = 440.0
"""Frequency of A4."""
HIGHEST_FRACTION = 0.4
"""Highest frequency of a partial, over the sampling rate."""
LEAST_AMPLITUDE = 0.02
"""Least amplitude of a partial, over the largest (-34 dB)."""

_SEMITONES = {"C": 0, "D": 2, "E": 4, "F": 5, "G": 7, "A": 9, "B": 11}
_PLATE_ASPECT = 1.27
_BAR_FIRST = 3.011
_STRING_STIFFNESS = 4e-4
_HAMMER_POSITION = 1.0 / 8.5
_HAMMER_HERTZ = 1500.0
_IMPERFECTION = 0.005


@dataclass(frozen=True)
class Instrument:
    """An instrument.

    Attributes
    ----------
    pitch : float [Hz]
        Frequency of the lowest partial by default.
    partials
        Function of (pitch, highest frequency, random numbers) that gives frequencies (n,) [Hz] and
        relative amplitudes (n,).
    damping : float [1/s]
        Damping at frequency 0.
    loss : float
        Loss factor of the material; pi f `loss` is added to the damping at frequency f.
    knock : float
        Peak of the noise of the blow, relative to the sum of the partials' amplitudes.
    knock_damping : float [1/s]
        Damping of that noise.
    """

    pitch: float
    partials: Callable[[float, float, np.random.Generator], tuple[Array, Array]]
    damping: float
    loss: float
    knock: float
    knock_damping: float


def note_hertz(note: str) -> float:
    """Frequency of a note such as C4 or F#3, in equal temperament from A4 = 440 Hz.

    Raises
    ------
    UserError
        If it is no note.

    Examples
    --------
    >>> round(note_hertz("C4"), 2)
    261.63
    """
    parts = re.fullmatch(r"([A-G])([#b]?)(-?\d)", note)
    if parts is None:
        raise UserError(f"{note!r} is not a note, expected one such as C4, F#3 or Bb5")
    letter, accidental, octave = parts.groups()
    semitone = _SEMITONES[letter] + {"": 0, "#": 1, "b": -1}[accidental] + 12 * int(octave)
    a4 = _SEMITONES["A"] + 12 * 4
    return float(CONCERT_HERTZ * 2.0 ** ((semitone - a4) / 12.0))


def synthesised(
    instrument: str, pitch: float | None, seconds: float, rate: int, seed: int
) -> ModalSound:
    """The sound of a strike; the residual is the noise of the blow.

    Parameters
    ----------
    instrument : str
        One of `INSTRUMENTS`.
    pitch : float or None [Hz]
        Frequency of the lowest partial; the instrument's own if None.
    seconds : float [s]
        Duration.
    rate : int [Hz]
        Samples per second.
    seed : int
        Seed of the imperfections, the place of the strike, and the noise.

    Raises
    ------
    UserError
        If the pitch is too high for the sampling rate.
    """
    kind = INSTRUMENTS[instrument]
    pitch = kind.pitch if pitch is None else pitch
    highest = HIGHEST_FRACTION * rate
    if not 20.0 <= pitch < highest:
        raise UserError(
            f"a pitch of {pitch:g} Hz cannot be sampled at {rate} Hz, expected 20 Hz to "
            f"{highest:g} Hz"
        )
    random = np.random.default_rng(seed)
    frequencies, amplitudes = kind.partials(pitch, highest, random)
    order = np.argsort(frequencies)
    order = order[(amplitudes >= LEAST_AMPLITUDE * amplitudes.max())[order]]
    frequencies, amplitudes = frequencies[order], amplitudes[order] / amplitudes[order].sum()
    count = round(seconds * rate)
    fading = np.exp(-kind.knock_damping / rate * np.arange(count))
    return ModalSound(
        frequencies=frequencies,
        dampings=kind.damping + np.pi * kind.loss * frequencies,
        amplitudes=amplitudes,
        phases=np.zeros(len(frequencies)),
        residual=kind.knock * fading * random.uniform(-1.0, 1.0, count),
        rate=rate,
        evidence={"instrument": instrument, "pitch_hz": pitch, "seed": seed},
    )


def _plate(pitch: float, highest: float, random: np.random.Generator) -> tuple[Array, Array]:
    m, n = (part.ravel() for part in np.meshgrid(np.arange(1, 8), np.arange(1, 8)))
    frequencies = pitch * (m**2 + (_PLATE_ASPECT * n) ** 2) / (1.0 + _PLATE_ASPECT**2)
    frequencies *= random.normal(1.0, _IMPERFECTION, len(m))
    x, y = random.uniform(0.2, 0.45, 2)
    amplitudes = np.abs(np.sin(np.pi * m * x) * np.sin(np.pi * n * y)) / frequencies**0.5
    kept = frequencies < min(highest, 30.0 * pitch)
    return frequencies[kept], amplitudes[kept]


def _bar(pitch: float, highest: float, random: np.random.Generator) -> tuple[Array, Array]:
    n = np.arange(1, 7)
    frequencies = pitch * (np.where(n == 1, _BAR_FIRST, 2.0 * n + 1.0) / _BAR_FIRST) ** 2
    frequencies *= random.normal(1.0, _IMPERFECTION, len(n))
    amplitudes = random.uniform(0.5, 1.0, len(n)) / n
    kept = frequencies < highest
    return frequencies[kept], amplitudes[kept]


def _string(pitch: float, highest: float, random: np.random.Generator) -> tuple[Array, Array]:
    n = np.arange(1, 41)
    stiff = np.sqrt((1.0 + _STRING_STIFFNESS * n**2) / (1.0 + _STRING_STIFFNESS))
    frequencies = pitch * n * stiff
    amplitudes = np.abs(np.sin(np.pi * n * _HAMMER_POSITION)) / n
    amplitudes *= np.exp(-frequencies / _HAMMER_HERTZ) * random.uniform(0.8, 1.2, len(n))
    kept = frequencies < highest
    return frequencies[kept], amplitudes[kept]


INSTRUMENTS = {
    "metal": Instrument(420.0, _plate, 3.0, 1e-3, 0.02, 300.0),
    "wood": Instrument(520.0, _bar, 12.0, 1.5e-2, 0.15, 250.0),
    "piano": Instrument(note_hertz("C4"), _string, 0.8, 1e-3, 0.02, 150.0),
}
"""Instruments by name."""
