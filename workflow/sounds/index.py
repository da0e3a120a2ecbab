"""The page that leads to the examples."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from workflow.report.audio import wav_uri
from workflow.report.page import page_template
from workflow.report.table import Column, Table, read_table
from workflow.sounds.results import Found

PLAYED_SECONDS = 1.0


def build(examples: Sequence[Found]) -> tuple[str, Table]:
    """The page as HTML, and its table."""
    table = summary(examples)
    page = page_template("sounds/index.html.j2").render(
        title="Sound design",
        examples=[_described(found) for found in examples],
        table=table,
    )
    return page, table


def summary(examples: Sequence[Found]) -> Table:
    """One row for every example: its last edit."""
    return Table(
        "sounds",
        "Cost before and after the last edit of every example, and the largest difference of a "
        "frequency from its target.",
        [
            Column("example", "Example", shown=False),
            Column("title", "Example"),
            Column("points", "Struck points"),
            Column("modes", "Modes", "count"),
            Column("cost_before", "Cost before", "score"),
            Column("cost", "after", "score"),
            Column("fall", "Fall", "share"),
            Column("worst", "Largest difference [bark]", "fraction", "bark"),
            Column("seconds", "Time", "seconds", "s"),
            Column("per_minute", "Evaluations a minute", "count"),
        ],
        [_row(found) for found in examples],
    )


def _row(found: Found) -> dict[str, Any]:
    folder = found.folder / "tables"
    last = read_table(folder / "designs.json").rows[-1]
    rows = read_table(folder / "frequencies.json").rows
    kept = ("points", "cost_before", "cost", "fall", "seconds", "per_minute")
    return {
        "example": found.example.name,
        "title": found.example.title,
        "modes": len(rows),
        "worst": max(abs(row["found_bark"]) for row in rows),
        **{key: last[key] for key in kept},
    }


def _described(found: Found) -> dict[str, Any]:
    """What is said of an example, and how it sounds at its targets."""
    example = found.example
    return {
        "name": example.name,
        "title": example.title,
        "figure": example.figure,
        "about": example.about,
        "sounds": [
            {"name": target.name, "source": _player(found, target.name)}
            for target in example.targets
        ],
    }


def _player(found: Found, name: str) -> str:
    """The target's clip and then the sound that was found, each as loud as it can be."""
    import numpy as np

    parts = []
    rate = 0
    for state in ("clips", "after"):
        sound, rate = found.sound(state, name)
        part = sound[: round(PLAYED_SECONDS * rate)]
        parts.append(part / max(float(np.abs(part).max()), 1e-30))
    return wav_uri(np.concatenate(parts), rate, 1.0)
