"""Spectrograms of sounds."""

from __future__ import annotations

from collections.abc import Iterable

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from solver.response.response import FLOOR_DECIBELS, SAMPLE_RATE_HERTZ, decibels, spectrogram
from workflow.report.style import MUTED, SETTINGS

Array = NDArray[np.float64]


def spectrogram_figure(
    sound: Array, loudest: float, highest: float, rate: int = SAMPLE_RATE_HERTZ
) -> Figure:
    """Levels of a sound [dB] below the magnitude `loudest`, up to the frequency `highest` [Hz]."""
    times, hertz, magnitudes = spectrogram(sound, rate)
    shown = hertz <= highest
    levels = decibels(magnitudes[shown], loudest)
    with plt.rc_context({**SETTINGS, "axes.grid": False}):
        figure, axes = plt.subplots(figsize=(4.7, 2.9))
        extent = (1e3 * times[0], 1e3 * times[-1], 0.0, 1e-3 * hertz[shown][-1])
        image = axes.imshow(
            levels,
            aspect="auto",
            origin="lower",
            extent=extent,
            vmin=FLOOR_DECIBELS,
            vmax=0.0,
            cmap="magma",
        )
        figure.colorbar(image, ax=axes, label="level [dB]", pad=0.02).outline.set_edgecolor(MUTED)
        axes.set(xlabel="time [ms]", ylabel="frequency [kHz]", xlim=(0.0, extent[1]))
    return figure


def highest_hertz(sounds: Iterable[tuple[Array, int]]) -> float:
    """Frequency up to which the loudest sounds, each with its rate, reach, with room above."""
    highest, limit = 0.0, np.inf
    for sound, rate in sounds:
        _, hertz, magnitudes = spectrogram(sound, rate)
        heard = (decibels(magnitudes, float(magnitudes.max())) > FLOOR_DECIBELS).any(axis=1)
        highest = max(highest, float(hertz[heard].max()))
        limit = min(limit, float(hertz[-1]))
    return min(1.1 * highest + 200.0, limit)
