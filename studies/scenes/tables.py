"""Rows of the tables of the scenes."""

from __future__ import annotations

from collections.abc import Iterator

from studies.base.entry import Row
from studies.scenes.results import Scenes

HARDEST = 5
"""Impacts of a scene that are listed."""


def scenes(results: Scenes) -> Iterator[Row]:
    """One row for every scene: what there is, and what happens."""
    for scene in results.scenes:
        struck = [_impact(line) for line in scene.impacts]
        yield {
            **scene.told,
            "scene": scene.example.name,
            "title": scene.example.title,
            "impacts": len(struck),
            "first": struck[0]["seconds"] if struck else None,
            "hardest": max((row["impulse"] for row in struck), default=None),
            "wall": scene.wall_seconds,
        }


def files(results: Scenes) -> Iterator[Row]:
    """How large the files of every scene are."""
    for scene in results.scenes:
        yield {"scene": scene.example.name, "title": scene.example.title, **scene.sizes}


def impacts(results: Scenes) -> Iterator[Row]:
    """The hardest impacts of every scene, the hardest first."""
    for scene in results.scenes:
        rows = [_impact(line) for line in scene.impacts]
        rows.sort(key=lambda row: -row["impulse"])
        for number, row in enumerate(rows[:HARDEST], 1):
            yield {
                "scene": scene.example.name,
                "title": scene.example.title,
                "number": number,
                **row,
            }


def _impact(line: dict[str, str]) -> Row:
    return {
        "first": line["first"],
        "second": line["second"],
        "seconds": float(line["time_seconds"]),
        "impulse": float(line["impulse_newton_seconds"]),
        "speed": float(line["approach_metres_per_second"]),
        "duration": float(line["duration_seconds"]),
    }
