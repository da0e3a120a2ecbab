"""The page that leads to the examples."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from studies.base.media import wav_uri
from studies.base.page import Section, StudyPage, section
from studies.base.parts import audio, div, facts, figure, grid, html, prose
from studies.base.results import Results
from studies.base.table import Column, Row, Table, hidden, read_table, table
from studies.sounds.examples import OF_CLIPS, OF_RECORDINGS, WITHOUT_RECORDINGS, seeded
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
        return self._named(self.config["sound"][self.listed])

    def _named(self, names: Iterable[str]) -> list[SoundResults]:
        return [SoundResults(self.folder, name) for name in names]


class OfRecordings(Examples):
    """The same of those whose clips are real recordings."""

    listed = OF_RECORDINGS
    prefix = f"{OF_RECORDINGS}-"
    title = "Sounds of recordings"
    about = (
        "Recordings of real strikes, each on a solid of its kind: how close does a material bring "
        "the solid to the clip, and where does it not?"
    )


class OfClips(Examples):
    """Results of all pairs of a recording and a solid, designed with all defaults."""

    listed = OF_CLIPS
    prefix = f"{OF_CLIPS}-"
    title = "Sounds with all defaults"
    about = (
        "A recording, a solid of another kind, and nothing else said: does the design sound like "
        "the recording, and does it say so where it does not?"
    )

    @cached_property
    def seeded(self) -> list[SoundResults]:
        """Results of the pair that is designed by several seeds."""
        return self._named(seeded(self.config))


@table(
    hidden("example", "Example"),
    Column("title", "Example"),
    Column("points", "Struck points"),
    Column("modes", "Modes", "count"),
    Column("cost_before", "Cost before", "score"),
    Column("cost", "after", "score"),
    Column("fall", "Fall", "share"),
    Column("coarse_cents", "Coarse, rms [cents]", "fraction", "cents"),
    Column("fine_cents", "Fine, rms [cents]", "fraction", "cents"),
    Column("fine_bark", "Fine, rms [bark]", "fraction", "bark"),
    Column("worst", "Largest difference [bark]", "fraction", "bark"),
    Column("seconds", "Time", "seconds"),
    Column("per_minute", "Evaluations a minute", "count"),
)
def sounds(index: Examples) -> Iterator[Row]:
    """Cost before and after the last edit of every example, how far frequencies are from their
    targets on the coarse and on the fine solid (rms, each with the factor of its moduli that is
    best), and the largest difference of a frequency."""
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


@table(
    hidden("example", "Example"),
    Column("title", "Example"),
    Column("point", "Struck point"),
    Column("silence", "Silence [dB]", "fraction", "dB"),
    Column("before", "Before [dB]", "fraction", "dB"),
    Column("after", "After [dB]", "fraction", "dB"),
    Column("fine", "After, fine model [dB]", "fraction", "dB"),
    Column("wanted", "Modes designed [dB]", "fraction", "dB"),
    Column("modes", "All modes of the clip [dB]", "fraction", "dB"),
    keys="example point",
)
def distances(index: Examples) -> Iterator[Row]:
    """How far modes alone sound from the clips, the rms difference of their levels in bands, as the
    page of each example describes it. Modes designed are those of the clip that were asked for, as
    a perfect material sounds; all modes of the clip are what the extraction knows of it."""
    for results in index.examples:
        for row in _rows(results, "distances"):
            yield {"example": results.example.name, "title": results.example.title, **row}


def _rows(results: SoundResults, table: str) -> list[Row]:
    return read_table(results.file(f"tables/{table}.json")).rows


def page(index: Examples, tables: dict[str, Table]) -> StudyPage:
    """Build the page from its table and the sounds of all examples."""
    return StudyPage(
        title=index.title,
        kicker="examples",
        lede=index.about,
        sections=[
            section("Overview", *map(grid, tables.values())),
            *map(_heard, index.examples),
        ],
        footer="""This page holds its sounds and numbers; its tables are also files in a folder
            beside it.""",
    )


def _heard(results: SoundResults) -> Section:
    example = results.example
    led = '<a href="{}/page.html">Spectrograms, material, modes and files</a>'
    panels = []
    for target in example.targets:
        sounds = [results.sound(state, target.name) for state in (CLIPS, "after")]
        played = [sound[: round(PLAYED_SECONDS * rate)] for sound, rate in sounds]
        loud = [part / max(float(np.abs(part).max()), 1e-30) for part in played]
        source = wav_uri(np.concatenate(loud), sounds[-1][1], 1.0)
        name = html('<span class="name">{}</span>', target.name.capitalize())
        caption = facts(name, "target, then the sound that was found")
        panels.append(figure(caption, audio(source, f"{example.title}, {target.name}")))
    about = prose(f"{example.about} ({example.figure})", html(led, example.name))
    return section(example.title, about, div("panels", *panels), id=example.name)
