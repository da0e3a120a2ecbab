"""The page that leads to the examples."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from studies.base.entry import Row
from studies.base.media import wav_uri
from studies.base.page import rendered
from studies.base.results import Results
from studies.base.table import Table, read_table
from studies.sounds.examples import OF_RECORDINGS, WITHOUT_RECORDINGS
from studies.sounds.results import CLIPS, SoundResults

PLAYED_SECONDS = 1.0


@dataclass(frozen=True)
class Examples(Results):
    """The folder of all examples, those of a list of the configuration."""

    listed: ClassVar[str] = WITHOUT_RECORDINGS
    prefix: ClassVar[str] = ""
    title: ClassVar[str] = "Sound design"
    about: ClassVar[str] = (
        "A mesh, a few struck points, a clip for each: what material lets the object sound like "
        "that?"
    )

    @cached_property
    def examples(self) -> list[SoundResults]:
        """Results of every example."""
        return [SoundResults(self.folder, name) for name in self.config["sound"][self.listed]]


class OfRecordings(Examples):
    """The same of those whose clips are real recordings."""

    listed = OF_RECORDINGS
    prefix = f"{OF_RECORDINGS}-"
    title = "Sounds of recordings"
    about = (
        "Recordings of real strikes, each on a solid of its kind: how close does a material bring "
        "the solid to the clip, and where does it not?"
    )


def summary(index: Examples) -> Iterator[Row]:
    """One row for every example: its last edit."""
    for results in index.examples:
        rows = _rows(results, "frequencies")
        near = {row["solid"]: row for row in _rows(results, "nearness")}
        yield {
            **_rows(results, "designs")[-1],
            "example": results.example.name,
            "title": results.example.title,
            "modes": len(rows),
            "worst": max(abs(row["found_bark"]) for row in rows),
            "coarse_cents": near["coarse"]["rms_cents"],
            "fine_cents": near["fine"]["rms_cents"],
            "fine_bark": near["fine"]["rms_bark"],
        }


def distances(index: Examples) -> Iterator[Row]:
    """How far every example sounds from its clips."""
    for results in index.examples:
        for row in _rows(results, "distances"):
            yield {"example": results.example.name, "title": results.example.title, **row}


def _rows(results: SoundResults, table: str) -> list[Row]:
    """Rows of a table of an example's page."""
    return read_table(results.file(f"tables/{table}.json")).rows


def page(index: Examples, tables: dict[str, Table]) -> str:
    """Build the page from its table and the sounds of all examples."""
    return rendered(
        "studies/sounds/index.html.j2",
        title=index.title,
        about=index.about,
        examples=[(results.example, _players(results)) for results in index.examples],
        tables=tables,
    )


def _players(results: SoundResults) -> dict[str, str]:
    """By target: its clip and then the sound of the design, each as loud as it can be."""
    players = {}
    for target in results.example.targets:
        parts = []
        rate = 0
        for state in (CLIPS, "after"):
            sound, rate = results.sound(state, target.name)
            part = sound[: round(PLAYED_SECONDS * rate)]
            parts.append(part / max(float(np.abs(part).max()), 1e-30))
        players[target.name] = wav_uri(np.concatenate(parts), rate, 1.0)
    return players
