"""Display of sounds in a notebook: a player, length, loudness, and their course."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from carillon.arrays import Array
from carillon.notebook.card import Markup, card, table
from carillon.notebook.chart import Axis, stems, waveform
from carillon.notebook.player import player
from sound.clips.wav import PEAK, as_wav
from sound.levels import SoundLevel, end_dbfs

if TYPE_CHECKING:
    from sound.clips.extraction import ModalSound

BITS = 16
"""Bits of a sample that a page holds."""
LONGEST_SECONDS = 20.0
"""Length [s] that a page holds of a sound, 2.4 MB at 44,100 Hz."""
MOST_ROWS = 10
"""Modes that the table lists."""


def sound_html(samples: Array, rate: int, title: str = "Sound") -> str:
    """A card of samples (s,) or (s, c) at a rate [Hz]."""
    return card(
        title, level_facts(samples, rate), sound_player(samples, rate), _course(samples, rate)
    )


def level_facts(samples: Array, rate: int) -> list[str]:
    """Length and level of samples (s,) or (s, c)."""
    level = SoundLevel.of(samples, rate, end_dbfs(samples, rate))
    channels = "" if samples.ndim == 1 else f", {samples.shape[1]} channels"
    return [f"{len(samples) / rate:.3g} s at {rate:,} Hz{channels}", level.in_words()]


def sound_player(samples: Array, rate: int, label: str = "") -> Markup:
    """A player of samples (s,) or (s, c), whole numbers of `BITS` with dither.

    Those beyond full scale are scaled to just below it, and long ones cut, as is then written above
    the player.
    """
    told = [label] if label else []
    count = round(LONGEST_SECONDS * rate)
    if len(samples) > count:
        told.append(f"the first {LONGEST_SECONDS:g} s")
        samples = samples[:count]
    largest = float(np.abs(samples).max(initial=0.0))
    if largest > 1.0:
        told.append(f"times {PEAK / largest:.2g}, as it is beyond full scale")
        samples = samples * (PEAK / largest)
    return player(as_wav(samples, rate, BITS), ", ".join(told))


def modal_sound_html(sound: ModalSound) -> str:
    """A card of the modes of a clip: those with most energy, and the clip that they are from."""
    hertz, energies = sound.frequencies, sound.energies
    order = np.argsort(-energies)
    share = energies / (energies.sum() or 1.0)
    rows = [
        (
            f"{hertz[k]:,.1f}",
            f"{sound.dampings[k]:.3g}",
            f"{sound.amplitudes[k]:.2g}",
            f"{100.0 * share[k]:.1f} %",
        )
        for k in order[:MOST_ROWS]
    ]
    more = len(hertz) - len(rows)
    listed = table(
        ("Hz", "damping [1/s]", "amplitude", "of their energy"),
        rows,
        f"and {more} fainter ones" if more else "",
    )
    decibels = 10.0 * np.log10(np.maximum(share, 1e-12))
    low = min(-60.0, 10.0 * np.floor(decibels.min() / 10.0))
    x = Axis("frequency [Hz]", 0.0, float(hertz.max(initial=1.0)))
    chart = stems(x, Axis("energy [dB]", max(low, -120.0), 0.0), hertz[order], decibels[order])
    whole = sound.modal_part() + sound.residual
    clip = sound_player(whole, sound.rate, "the clip")
    return card(f"Clip of {len(hertz)} modes", level_facts(whole, sound.rate), chart, listed, clip)


def _course(samples: Array, rate: int) -> Markup | None:
    first = samples if samples.ndim == 1 else samples[:, 0]
    return waveform(first, rate) if len(first) else None
