"""The page that leads to the examples."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

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
        examples=[(results.example, _players(results)) for results in index.examples],
        table=tables["sounds"],
    )


def _players(results: SoundResults) -> dict[str, str]:
    """By target: its clip and then the sound of the design, each as loud as it can be."""
    players = {}
    for target in results.example.targets:
        parts = []
        rate = 0
        for state in ("clips", "after"):
            sound, rate = results.sound(state, target.name)
            part = sound[: round(PLAYED_SECONDS * rate)]
            parts.append(part / max(float(np.abs(part).max()), 1e-30))
        players[target.name] = wav_uri(np.concatenate(parts), rate, 1.0)
    return players
