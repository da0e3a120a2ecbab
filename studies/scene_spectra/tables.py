"""Rows of the table of the scene that is heard by several modes."""

from collections.abc import Iterator

import numpy as np

from carillon.fem.model import RIGID_MODES
from solver.files.modes_file import ESTIMATE
from sound.synthesis.spectral_distance import log_spectral_distance
from studies.base.table import Column, Row, hidden, table
from studies.scene_spectra.results import SceneSpectra
from studies.scene_spectra.scene import RENDERINGS
from workflow.variants import TRUTH


@table(
    hidden("rendering", "Modes"),
    Column("title", "Modes"),
    Column("about", "What they are"),
    Column("unknowns", "Unknowns", "count"),
    Column("solve_seconds", "Modes found in", "seconds"),
    Column("impacts", "Impacts", "count"),
    Column("frequency_error", "Frequency error", "percent"),
    Column("distance_decibels", "Distance [dB]", "fraction", "dB"),
    name="scene_spectra",
)
def scene_spectra(results: SceneSpectra) -> Iterator[Row]:
    """One scene of rigid bodies (Fig. 13), heard by modes of several models. Motion and contacts
    are those of the fine mesh each time. Unknowns and wall time of the modes are those of all
    bodies together. Distance is the rms difference of levels in third-octave bands over time from
    the rendering by the truth's modes; the error is that of the elastic frequencies, rms."""
    truth = results.pressures[TRUTH]
    for name, rendering in RENDERINGS.items():
        files = results.spectra[name]
        row = {
            "rendering": name,
            "title": rendering.title,
            "about": rendering.about,
            "unknowns": sum(each.model.n_dofs for each in files),
            "solve_seconds": sum(
                sum(value for key, value in each.attributes["timings"].items() if key != ESTIMATE)
                for each in files
            ),
            "impacts": results.told[name]["impacts"],
        }
        if name != TRUTH:
            sound = results.pressures[name]
            row["distance_decibels"] = log_spectral_distance(sound, truth, results.rate)
            row["frequency_error"] = _frequency_error(results, name)
        yield row


def _frequency_error(results: SceneSpectra, name: str) -> float:
    """Rms relative error of the elastic frequencies of all bodies, number by number."""
    errors = []
    for found, true in zip(results.spectra[name], results.spectra[TRUTH]):
        count = min(len(found.frequencies), len(true.frequencies))
        chosen = slice(RIGID_MODES, count)
        errors.append(found.frequencies[chosen] / true.frequencies[chosen] - 1.0)
    return float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
