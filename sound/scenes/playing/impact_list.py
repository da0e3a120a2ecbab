"""The impacts of a scene as a table (CSV)."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from carillon.files.atomic import atomic_path
from sound.scenes.performance import GROUND, Performance

COLUMNS = (
    "time_seconds",
    "first",
    "second",
    "x_m",
    "y_m",
    "z_m",
    "impulse_newton_seconds",
    "approach_metres_per_second",
    "duration_seconds",
)


def write_impacts(path: str | Path, performance: Performance) -> None:
    """Write when, where and how hard what struck what; the ground has the name `ground`.

    Raises
    ------
    UserError
        If the file cannot be written.
    """
    names = [each.name for each in performance.picture.objects]
    with atomic_path(path) as temporary, open(temporary, "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(COLUMNS)
        for impact in performance.impacts:
            pair = ["ground" if each == GROUND else names[each] for each in impact.pair]
            strength = float(np.linalg.norm(impact.impulse))
            numbers = [strength, impact.speed, impact.duration]
            table.writerow(
                [f"{impact.seconds:.6f}", *pair]
                + [f"{value:.6g}" for value in (*impact.position, *numbers)]
            )
