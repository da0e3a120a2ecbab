"""The page of a recording: what was found in it and what was not, to see and to hear."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.response.response import spectrogram
from studies.base.media import highest_hertz, inlined, spectrogram_figure, wav_uri
from studies.base.page import rendered
from studies.base.table import Table
from studies.recordings.measurement import MODES, RESIDUAL
from studies.recordings.plots import spectrum_figure
from studies.recordings.results import EXTRACTED, RecordingResults

Array = NDArray[np.float64]

SHOWN_SECONDS, PLAYED_SECONDS = 2.0, 4.0
"""Longest time of a spectrogram and of a player."""
LEAST_SECONDS = 0.1
"""Length to which shorter clips are filled up with silence, so that there is something to draw."""


def page(results: RecordingResults, tables: dict[str, Table]) -> str:
    """Build the page of a recording from its tables and files."""
    clip = results.searched
    parts = {"Clip": clip}
    if not results.refused:
        parts |= {"Residual": results.residual, "Modes alone": clip - results.residual}
    return rendered(
        "studies/recordings/page.html.j2",
        title=results.recording.title,
        recording=results.recording,
        summary=results.summary(),
        tables=tables,
        spectrum=inlined(spectrum_figure(results), "spectrum"),
        panels=[_panel(results, name, part) for name, part in parts.items()],
        files=[] if results.refused else [f"{EXTRACTED}/{name}" for name in (MODES, RESIDUAL)],
    )


def _panel(results: RecordingResults, name: str, sound: Array) -> dict[str, Any]:
    """Spectrogram and player of a part of the clip, on the clip's own scales."""
    clip, rate = _filled(results.searched, results.rate), results.rate
    loudest = float(spectrogram(clip, rate)[2].max())
    shown = _filled(sound, rate)[: round(SHOWN_SECONDS * rate)]
    figure = spectrogram_figure(shown, loudest, highest_hertz([(clip, rate)]), rate)
    peak = float(np.abs(clip).max())
    return {
        "name": name,
        "plot": inlined(figure, f"sound-{name.lower().replace(' ', '-')}"),
        "source": wav_uri(sound[: round(PLAYED_SECONDS * rate)], rate, peak),
    }


def _filled(sound: Array, rate: int) -> Array:
    return np.pad(sound, (0, max(0, round(LEAST_SECONDS * rate) - len(sound))))
