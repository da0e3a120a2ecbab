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
from workflow.studies.sounds.examples import examples
from workflow.studies.sounds.results import Found

PLAYED_SECONDS = 1.0


class Examples(Results):
    """The folder of all examples."""

    @cached_property
    def found(self) -> list[Found]:
        """Results of every example."""
        described = examples(self.config).values()
        return [Found(self.folder, self.config, example) for example in described]


def summary(results: Examples) -> Iterator[Row]:
    """One row for every example: its last edit."""
    for found in results.found:
        tables = found.folder / "tables"
        rows = read_table(tables / "frequencies.json").rows
        yield {
            **read_table(tables / "designs.json").rows[-1],
            "example": found.example.name,
            "title": found.example.title,
            "modes": len(rows),
            "worst": max(abs(row["found_bark"]) for row in rows),
        }


def page(results: Examples, tables: dict[str, Table]) -> str:
    """Build the page from its table and the sounds of all examples."""
    return rendered(
        "sounds/index.html.j2",
        title="Sound design",
        examples=[_described(found) for found in results.found],
        table=tables["sounds"],
    )


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
    parts = []
    rate = 0
    for state in ("clips", "after"):
        sound, rate = found.sound(state, name)
        part = sound[: round(PLAYED_SECONDS * rate)]
        parts.append(part / max(float(np.abs(part).max()), 1e-30))
    return wav_uri(np.concatenate(parts), rate, 1.0)
