"""Tables of modes, JSON and CSV, for programs that synthesise them or for scripts of game engines.

A row is a mode: frequency, decay, and the amplitude that it has at each point.
"""

import csv
import io
import json
from pathlib import Path
from typing import Any

from carillon import __version__
from carillon.files.atomic import atomic_path
from sound.export.modal_model import ModalModel
from sound.export.names import file_names

FORMAT = "carillon modal table 1"
UNITS = {
    "gain": "factor that keeps an impulse of 1 N s at the loudest point within full scale",
    "frequency_hz": "frequency f of the mode",
    "decay_per_second": "d of the envelope exp(-d t)",
    "t60_seconds": "ln(1000) / d, in which the mode decays by 60 dB",
    "amplitudes": "samples of full scale after an impulse of 1 N s along the inward normal",
    "position_m": "in the axes of the design, in metres",
    "inward": "unit vector into the solid",
    "sound": "impulse times the sum over modes of amplitude exp(-d t) sin(2 pi f t)",
}
"""Meaning of the keys."""


def write_modal_json(path: str | Path, model: ModalModel) -> None:
    """Write the modes, and the amplitudes of each point, in the order of the modes.

    Arrays are of objects or of numbers, which Unity's `JsonUtility` reads.  Raises UserError if the
    file cannot be written.
    """
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(modal_json(model), indent=1))


def modal_json(model: ModalModel) -> dict[str, Any]:
    """The content of the JSON file."""
    modes = zip(model.frequencies, model.dampings, model.decay_times, strict=True)
    return {
        "format": FORMAT,
        "generator": f"Carillon {__version__}",
        "name": model.name,
        "gain": model.gain,
        "units": UNITS,
        "modes": [
            {"frequency_hz": float(f), "decay_per_second": float(d), "t60_seconds": float(t60)}
            for f, d, t60 in modes
        ],
        "points": [
            {
                "name": point.name,
                "position_m": point.position.tolist(),
                "inward": point.inward.tolist(),
                "amplitudes": amplitudes.tolist(),
            }
            for point, amplitudes in zip(model.points, model.amplitudes, strict=True)
        ],
    }


def write_modal_csv(path: str | Path, model: ModalModel) -> None:
    """Write a line for each mode, and a column of amplitudes for each point.

    The first column names the rows, as Unreal's data tables want it.  Raises UserError if the file
    cannot be written.
    """
    with atomic_path(path) as temporary:
        temporary.write_text(modal_csv(model))


def modal_csv(model: ModalModel) -> str:
    """The content of the CSV file."""
    content = io.StringIO()
    table = csv.writer(content, lineterminator="\n")
    columns = [f"amplitude_{each}" for each in file_names([point.name for point in model.points])]
    table.writerow(["mode", "frequency_hz", "decay_per_second", "t60_seconds", *columns])
    rows = zip(model.frequencies, model.dampings, model.decay_times, model.amplitudes.T)
    for number, (frequency, damping, t60, amplitudes) in enumerate(rows, start=1):
        values = (frequency, damping, t60, *amplitudes)
        table.writerow([number, *(f"{value:.9g}" for value in values)])
    return content.getvalue()


def impact_objects(model: ModalModel) -> list[str]:
    """Contents of `.impobj` files, one for each point, of Unreal's plug-in Impact SFX Synthesis.

    Each is JSON of amplitude, decay [1/s] and frequency [Hz] of every mode in a row.  The
    amplitudes of all points have one factor, with which those of the loudest point sum to 1: the
    plug-in clips beyond that, and ends a sound that is 60 dB lower.
    """
    loudest = float(model.amplitudes.sum(axis=1).max()) or 1.0
    texts = []
    for amplitudes in model.amplitudes / loudest:
        order = (-amplitudes).argsort(kind="stable")  # the plug-in may use the first modes alone
        rows = zip(amplitudes[order], model.dampings[order], model.frequencies[order])
        data = [float(f"{value:.9g}") for row in rows for value in row]
        texts.append(json.dumps({"Version": 1, "ModalData": data}))
    return texts
