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
    """An instrument: its lowest partial has the frequency `pitch` [Hz] by default.

    `partials` gives frequencies (n,) [Hz] and relative amplitudes (n,) from the pitch and random
    numbers.  The damping at frequency f is `damping` [1/s] plus pi f `loss`,
    the material's loss factor.  The noise of the blow has the peak `knock`, relative to the sum of
    the partials' amplitudes, and is damped by `knock_damping` [1/s].
    """

    pitch: float
    partials: Callable[[float, np.random.Generator], tuple[Array, Array]]
    damping: float
    loss: float
    knock: float
    knock_damping: float


def note_hertz(note: str) -> float:
    """Frequency of a note such as C4 or F#3, in equal temperament from A4 = 440 Hz.

    Raises UserError if it is no note.

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
    """The sound of a strike of one of `INSTRUMENTS`; the residual is the noise of the blow.

    Its lowest partial has the frequency `pitch` [Hz], the instrument's own if None, and its rate is
    in Hz.  Imperfections, the place of the strike and the noise are random, by the seed.  Raises
    UserError if the pitch is too high for the sampling rate.
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
    frequencies, amplitudes = kind.partials(pitch, random)
    audible = frequencies < highest
    frequencies, amplitudes = frequencies[audible], amplitudes[audible]
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


def _plate(pitch: float, random: np.random.Generator) -> tuple[Array, Array]:
    m, n = (part.ravel() for part in np.meshgrid(np.arange(1, 8), np.arange(1, 8)))
    frequencies = pitch * (m**2 + (_PLATE_ASPECT * n) ** 2) / (1.0 + _PLATE_ASPECT**2)
    frequencies *= random.normal(1.0, _IMPERFECTION, len(m))
    x, y = random.uniform(0.2, 0.45, 2)
    amplitudes = np.abs(np.sin(np.pi * m * x) * np.sin(np.pi * n * y)) / frequencies**0.5
    kept = frequencies < 30.0 * pitch
    return frequencies[kept], amplitudes[kept]


def _bar(pitch: float, random: np.random.Generator) -> tuple[Array, Array]:
    n = np.arange(1, 7)
    frequencies = pitch * (np.where(n == 1, _BAR_FIRST, 2.0 * n + 1.0) / _BAR_FIRST) ** 2
    frequencies *= random.normal(1.0, _IMPERFECTION, len(n))
    return frequencies, random.uniform(0.5, 1.0, len(n)) / n


def _string(pitch: float, random: np.random.Generator) -> tuple[Array, Array]:
    n = np.arange(1, 41)
    stiff = np.sqrt((1.0 + _STRING_STIFFNESS * n**2) / (1.0 + _STRING_STIFFNESS))
    frequencies = pitch * n * stiff
    amplitudes = np.abs(np.sin(np.pi * n * _HAMMER_POSITION)) / n
    amplitudes *= np.exp(-frequencies / _HAMMER_HERTZ) * random.uniform(0.8, 1.2, len(n))
    return frequencies, amplitudes


INSTRUMENTS = {
    "metal": Instrument(420.0, _plate, 3.0, 1e-3, 0.02, 300.0),
    "wood": Instrument(520.0, _bar, 12.0, 1.5e-2, 0.15, 250.0),
    "piano": Instrument(note_hertz("C4"), _string, 0.8, 1e-3, 0.02, 150.0),
}
"""Instruments by name."""
