"""The page of a recording: what was found in it and what was not, to see and to hear."""

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from solver.response.response import spectrogram
from studies.base.media import highest_hertz, inlined, spectrogram_figure, wav_uri
from studies.base.page import StudyPage, origins, section
from studies.base.parts import audio, div, facts, figure, grid, html, plot, prose, tiles
from studies.base.table import Row, Table
from studies.recordings.measurement import MODES, RESIDUAL
from studies.recordings.plots import spectrum_figure
from studies.recordings.recordings import EXTRACTED
from studies.recordings.results import RecordingResults

Array = NDArray[np.float64]

SHOWN_SECONDS, PLAYED_SECONDS = 2.0, 4.0
"""Longest time of a spectrogram and of a player."""
LEAST_SECONDS = 0.1
"""Length to which shorter clips are filled up with silence, so that there is something to draw."""
SPECTRUM = """Spectra from where modes ring freely, under half a Hann window, below the loudest
    line. Stems are modes; their height is the amplitude at the strike below the largest, which is
    not the height of a peak: what fades quickly is loud for a short time. Triangles are strong
    peaks that no mode accounts for."""
FOOTER = html("""This page holds its figures, sounds and numbers; its tables are also files in
    <span class="file">tables/</span> beside it.""")


def page(results: RecordingResults, tables: dict[str, Table]) -> StudyPage:
    """Build the page of a recording from its tables and files."""
    recording, refused = results.recording, results.refused
    clip = results.searched
    sounds = {"Clip": clip}
    if not refused:
        sounds |= {"Residual": results.residual, "Modes alone": clip - results.residual}
    files = (html('<a href="{0}/{1}">{0}/{1}</a>', EXTRACTED, name) for name in (MODES, RESIDUAL))
    modes = (
        section(
            "Modes",
            prose(html("Files: {}.", html(", ").join(files))),
            grid(tables["missed"]) if tables["missed"].rows else "",
            grid(tables["modes"]),
        )
        if not refused
        else None
    )
    panels = (_panel(results, name, part) for name, part in sounds.items())
    spectrum = inlined(spectrum_figure(results), "spectrum")
    return StudyPage(
        title=recording.title,
        kicker=f"extraction of modes · {recording.kind}, {recording.split}",
        lede=html("{0.file}, {1:seconds}, of the package {0.package}.", recording, results.seconds),
        sections=[
            section("Result", _result(results.summary())),
            section("Spectrum", plot(spectrum, SPECTRUM)),
            section(
                "Sounds",
                div("panels", *panels),
                prose("All on the scales of the clip; longer ones are cut."),
            ),
            modes,
            origins(tables["provenance"], "config.yaml in the folder above the recordings"),
        ],
        footer=FOOTER,
    )


def _result(summary: Row) -> Markup:
    if summary["said"]:
        return prose(html("The clip was refused: {said}.", **summary))
    return tiles(
        (
            "{decibels:fraction} dB",
            """<b>Explained</b>: {explained:share} of the energy from where modes ring freely;
                {before:share} of the clip’s comes before""",
            "ddfem_hcms_ec",
        ),
        ("{modes:count} modes", "<b>Found</b> in the clip", "hcms_ec"),
        (
            "{missed:count} of {peaks:count}",
            "<b>Strong peaks</b> that no mode accounts for",
            "speed",
        ),
        (
            "{cpu:seconds}",
            """<b>Processor time</b>, the start of the program included;
                {cpu_rate:fraction} s for a second of sound without it""",
            "proof",
        ),
        **summary,
    )


def _panel(results: RecordingResults, name: str, sound: Array) -> Markup:
    clip, rate = _filled(results.searched, results.rate), results.rate
    loudest = float(spectrogram(clip, rate)[2].max())
    shown = _filled(sound, rate)[: round(SHOWN_SECONDS * rate)]
    drawn = spectrogram_figure(shown, loudest, highest_hertz([(clip, rate)]), rate)
    peak = float(np.abs(clip).max())
    source = wav_uri(sound[: round(PLAYED_SECONDS * rate)], rate, peak)
    return figure(
        facts(html('<span class="name">{}</span>', name)),
        inlined(drawn, f"sound-{name.lower().replace(' ', '-')}"),
        audio(source, f"{results.recording.title}, {name.lower()}"),
        class_="plot",
    )


def _filled(sound: Array, rate: int) -> Array:
    return np.pad(sound, (0, max(0, round(LEAST_SECONDS * rate) - len(sound))))
