"""Spectrograms of the renderings side by side."""

from typing import Any

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

from solver.response.response import FLOOR_DECIBELS, decibels, spectrogram
from studies.base.colours import MUTED
from studies.base.media import highest_hertz
from studies.scene_spectra.results import SceneSpectra
from studies.scene_spectra.scene import RENDERINGS
from workflow.variants import TRUTH


def spectrograms_figure(results: SceneSpectra) -> Figure:
    """Levels [dB] below the loudest of the truth, one panel for every kind of modes."""
    rate, pressures = results.rate, results.pressures
    distances = {
        row["rendering"]: row.get("distance_decibels")
        for row in results.table("scene_spectra").rows
    }
    highest = highest_hertz([(pressures[TRUTH], rate)])
    loudest = float(spectrogram(pressures[TRUTH], rate)[2].max())
    with plt.rc_context({"axes.grid": False}):
        figure, panels = plt.subplots(
            1, len(RENDERINGS), figsize=(2.6 * len(RENDERINGS), 3.1), sharey=True, squeeze=False
        )
        for axes, (name, rendering) in zip(panels[0], RENDERINGS.items()):
            times, hertz, magnitudes = spectrogram(pressures[name], rate)
            shown = hertz <= highest
            extent = (times[0], times[-1], 0.0, 1e-3 * hertz[shown][-1])
            shades: dict[str, Any] = {"vmin": FLOOR_DECIBELS, "vmax": 0.0, "cmap": "magma"}
            image = axes.imshow(
                decibels(magnitudes[shown], loudest),
                aspect="auto",
                origin="lower",
                extent=extent,
                **shades,
            )
            off = distances[name]
            about = "reference" if off is None else f"{off:.1f} dB off"
            axes.set(xlabel="time [s]", title=f"{rendering.title}\n{about}")
            axes.title.set_fontsize(8.0)
        panels[0, 0].set_ylabel("frequency [kHz]")
        bar = figure.colorbar(image, ax=panels[0].tolist(), label="level [dB]", pad=0.01)
        bar.outline.set_edgecolor(MUTED)
    return figure
