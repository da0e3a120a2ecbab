"""The table of levels of a set of sounds, which tells how loud the strikes were to each other."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from carillon import __version__
from sound.export.mastering import PEAK_DECIBELS
from sound.levels import decibels

FORMAT = "carillon sound set 1"
"""Name of the format of the table, in its key `format`."""
COLUMNS = {
    "file": "name of the WAV file",
    "point": "name of the struck point",
    "strength_newton_seconds": "impulse along the inward normal",
    "variation": "1 at the point itself, others near to it",
    "gain_db": "to play the file with, so that all files are as loud to each other as the strikes",
    "peak_db": "peak of the file, below full scale",
    "rms_db": "root mean square of the file, below full scale",
    "rendered_peak_db": "peak of the sound before it was scaled; clips of targets have full scale",
    "seconds": "length of the file",
    "contact_seconds": "duration of the force",
    "x_m": "where it was struck, in the axes of the design",
    "y_m": "",
    "z_m": "",
}
"""Columns of the table of levels, and what they mean."""
SILENCE_DECIBELS = -240.0
"""Level of silence in the table [dB], since JSON has no infinity."""


@dataclass(frozen=True)
class LevelRow:
    """A row of the table of levels, see `COLUMNS`."""

    file: str
    point: str
    strength_newton_seconds: float
    variation: int
    gain_db: float
    peak_db: float
    rms_db: float
    rendered_peak_db: float
    seconds: float
    contact_seconds: float
    x_m: float
    y_m: float
    z_m: float


def with_gains(sounds: Sequence[tuple[float, LevelRow]]) -> list[LevelRow]:
    """Rows with the gains [dB] that make files as loud to each other as the strikes were.

    `sounds`: what each sound was multiplied by, and its row.  The greatest gain is 0 dB.
    """
    least = min(gain for gain, _ in sounds)
    return [
        LevelRow(**{**asdict(level), "gain_db": decibels(least / gain) + 0.0})
        for gain, level in sounds
    ]


def levels_csv(levels: Sequence[LevelRow]) -> str:
    """The table of levels as CSV."""
    content = io.StringIO()
    table = csv.writer(content, lineterminator="\n")
    table.writerow(COLUMNS)
    for level in levels:
        cells = asdict(level).values()
        table.writerow([f"{cell:.6g}" if isinstance(cell, float) else cell for cell in cells])
    return content.getvalue()


def levels_json(
    name: str, levels: Sequence[LevelRow], rate: int, seed: int, files: Sequence[str] = ()
) -> str:
    """The table of levels as JSON, with the sampling rate [Hz] and the seed of the variations.

    `files`: all that the export writes, which a later one into the same folder removes.
    """
    content: dict[str, Any] = {
        "format": FORMAT,
        "generator": f"Carillon {__version__}",
        "name": name,
        "peak_db": PEAK_DECIBELS,
        "rate_hz": rate,
        "bits": 24,
        "seed": seed,
        "columns": COLUMNS,
        "sounds": [asdict(level) for level in levels],
        "files": list(files),
    }
    return json.dumps(content, indent=1)


def level_of(ratio: float) -> float:
    """Level [dB] of a ratio of amplitudes as the table has it, `SILENCE_DECIBELS` or more.

    Examples
    --------
    >>> level_of(0.1), level_of(0.0)
    (-20.0, -240.0)
    """
    return max(decibels(ratio), SILENCE_DECIBELS)
