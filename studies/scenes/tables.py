"""Rows of the tables of the scenes."""

from collections.abc import Iterator

from studies.base.table import Column, Row, hidden, table
from studies.scenes.results import Scenes

HARDEST = 5
"""Impacts of a scene that are listed."""


@table(
    hidden("scene", "Scene"),
    Column("title", "Scene"),
    Column("objects", "Objects", "count"),
    Column("modes", "Modes", "count"),
    Column("impacts", "Impacts", "count"),
    Column("first", "First impact", "seconds"),
    Column("hardest", "Hardest impact [N s]", "fraction"),
    Column("full_scale", "Full scale [dB]", "fraction", "dB", source="full_scale_decibels"),
    Column("seconds", "Sound", "seconds"),
    Column("bodies", "Bodies", "seconds", source="timings.bodies"),
    Column("motion", "Motion", "seconds", source="timings.motion"),
    Column("contacts", "Contacts", "seconds", source="timings.contacts"),
    Column("ringing", "Hearing", "seconds", source="timings.sound"),
    Column("wall", "In all", "seconds"),
)
def scenes(results: Scenes) -> Iterator[Row]:
    """What every scene holds, what happens in it, and how long the computer worked on it: on
    bodies, which are modes of meshes and convex parts of all solids, on motion and contacts, on
    what is heard, and in all, with start, film and page. An impact is as hard as its impulse; full
    scale of a sound is its loudest sample."""
    for scene in results.scenes:
        struck = [_impact(line) for line in scene.impacts]
        yield {
            **scene.told,
            **scene.names,
            "impacts": len(struck),
            "first": struck[0]["seconds"] if struck else None,
            "hardest": max((row["impulse"] for row in struck), default=None),
            "wall": scene.wall_seconds,
        }


@table(
    hidden("scene", "Scene"),
    Column("title", "Scene"),
    Column("out", "Sound, WAV", "bytes"),
    Column("video", "Film, MP4", "bytes"),
    Column("gltf", "Motion, GLB", "bytes"),
    Column("page", "Page", "bytes"),
    Column("impacts", "Impacts, CSV", "bytes"),
)
def files(results: Scenes) -> Iterator[Row]:
    """Sizes of the files of every scene."""
    for scene in results.scenes:
        yield {**scene.names, **scene.sizes}


@table(
    hidden("scene", "Scene"),
    Column("title", "Scene"),
    Column("number", "Rank", "count"),
    Column("seconds", "Time", "seconds"),
    Column("first", "What"),
    Column("second", "strikes what"),
    Column("impulse", "Impulse [N s]", "fraction"),
    Column("speed", "Approach [m/s]", "fraction", "m/s"),
    Column("duration", "Contact", "seconds"),
    keys="scene number",
)
def impacts(results: Scenes) -> Iterator[Row]:
    """The hardest impacts: when, what strikes what, the impulse, the speed at which they approach
    each other, and how long they touch by Hertz."""
    for scene in results.scenes:
        rows = [_impact(line) for line in scene.impacts]
        rows.sort(key=lambda row: -row["impulse"])
        for number, row in enumerate(rows[:HARDEST], 1):
            yield {**scene.names, "number": number, **row}


def _impact(line: dict[str, str]) -> Row:
    return {
        "first": line["first"],
        "second": line["second"],
        "seconds": float(line["time_seconds"]),
        "impulse": float(line["impulse_newton_seconds"]),
        "speed": float(line["approach_metres_per_second"]),
        "duration": float(line["duration_seconds"]),
    }
