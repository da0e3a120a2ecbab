"""The page that leads to the examples."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np

from workflow.studies.base.entry import Row
from workflow.studies.base.media import wav_uri
from workflow.studies.base.page import rendered
from workflow.studies.base.results import Results
from workflow.studies.base.table import Table, read_table
from workflow.studies.sounds.results import SoundResults

PLAYED_SECONDS = 1.0


class Examples(Results):
    """The folder of all examples."""

    @cached_property
    def examples(self) -> list[SoundResults]:
        """Results of every example."""
        return [SoundResults(self.folder, name) for name in self.config["sound"]["examples"]]


def summary(index: Examples) -> Iterator[Row]:
    """One row for every example: its last edit."""
    for results in index.examples:
        rows = read_table(results.file("tables/frequencies.json")).rows
        yield {
            **read_table(results.file("tables/designs.json")).rows[-1],
            "example": results.example.name,
            "title": results.example.title,
            "modes": len(rows),
            "worst": max(abs(row["found_bark"]) for row in rows),
        }


def page(index: Examples, tables: dict[str, Table]) -> str:
    """Build the page from its table and the sounds of all examples."""
    return rendered(
        "sounds/index.html.j2",
        title="Sound design",
        examples=[_described(results) for results in index.examples],
        table=tables["sounds"],
    )


def _described(results: SoundResults) -> dict[str, Any]:
    """What is said of an example, and how it sounds at its targets."""
    example = results.example
    return {
        "name": example.name,
        "title": example.title,
        "figure": example.figure,
        "about": example.about,
        "sounds": [
            {"name": target.name, "source": _player(results, target.name)}
            for target in example.targets
        ],
    }


def _player(results: SoundResults, name: str) -> str:
    """The target's clip and then the sound of the design, each as loud as it can be."""
    parts = []
    rate = 0
    for state in ("clips", "after"):
        sound, rate = results.sound(state, name)
        part = sound[: round(PLAYED_SECONDS * rate)]
        parts.append(part / max(float(np.abs(part).max()), 1e-30))
    return wav_uri(np.concatenate(parts), rate, 1.0)
