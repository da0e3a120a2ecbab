"""Figures of a recording's page."""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from studies.base.colours import COLOURS, INK, MUTED
from studies.base.style import logarithmic
from studies.recordings.peaks import HIGHEST_SHARE, LOWEST_HERTZ, spectrum
from studies.recordings.results import RecordingResults

Array = NDArray[np.float64]

FLOOR_DECIBELS = -80.0
"""Level below which nothing is drawn."""
_POINTS = 1200
"""Points of a line across the figure; more would not be seen."""


def spectrum_figure(results: RecordingResults) -> Figure:
    """Spectra of clip and residual, the modes as stems, and the peaks that they miss."""
    rate = results.rate
    figure, axes = plt.subplots(figsize=(9.0, 3.9))
    hertz, levels = spectrum(results.searched, rate)
    seen = (hertz >= LOWEST_HERTZ) & (hertz <= HIGHEST_SHARE * rate)
    loudest = float(levels[seen].max())
    style: dict[str, Any] = {"color": MUTED, "linewidth": 0.9, "label": "clip"}
    axes.plot(*_outline(hertz[seen], levels[seen] - loudest), **style)
    if not results.refused:
        _, left = spectrum(results.residual, rate)
        style = {"color": COLOURS["hcms_ec"], "linewidth": 0.9, "label": "residual"}
        axes.plot(*_outline(hertz[seen], left[seen] - loudest), **style)
        _draw_modes(axes, results)
        peaks = results.peaks
        places = peaks.hertz[results.missed], peaks.decibels[results.missed] + 2.0
        axes.plot(*places, "v", ms=5.0, color=COLOURS["random"], ls="none", label="missed peak")
    axes.set(
        xlabel="frequency [Hz]",
        ylabel="level [dB]",
        ylim=(FLOOR_DECIBELS, 5.0),
        xlim=(LOWEST_HERTZ, HIGHEST_SHARE * rate),
    )
    logarithmic(axes.xaxis)
    figure.legend(loc="outside upper right", ncols=4, columnspacing=1.2)
    return figure


def _draw_modes(axes: Any, results: RecordingResults) -> None:
    amplitudes = np.array(results.found["amplitudes"][0])
    levels = np.maximum(20.0 * np.log10(amplitudes / amplitudes.max()), FLOOR_DECIBELS)
    style: dict[str, Any] = {"color": COLOURS["ddfem_hcms_ec"], "linewidth": 0.9, "alpha": 0.8}
    axes.vlines(results.frequencies, FLOOR_DECIBELS, levels, **style)
    style = {"color": COLOURS["ddfem_hcms_ec"], "markeredgecolor": INK, "markeredgewidth": 0.3}
    axes.plot(results.frequencies, levels, "o", ms=3.5, ls="none", label="mode", **style)


def _outline(hertz: Array, levels: Array) -> tuple[Array, Array]:
    """The highest level in each of many steps of a logarithmic axis, where that is."""
    steps = np.geomspace(hertz[0], hertz[-1], _POINTS)
    begins = np.unique(np.searchsorted(hertz, steps[:-1]))
    ends = [*begins[1:], len(hertz)]
    chosen = [begin + int(np.argmax(levels[begin:end])) for begin, end in zip(begins, ends)]
    return hertz[chosen], np.maximum(levels[chosen], FLOOR_DECIBELS)
