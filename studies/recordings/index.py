"""The page that leads to the recordings, and the tables of all of them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from statistics import median

from studies.base.conditions import ONE_COLD_RUN, Record, measured
from studies.base.entry import Row
from studies.base.page import rendered
from studies.base.results import Results
from studies.base.table import Table
from studies.recordings.formats import FORMATS, RECORDING
from studies.recordings.recordings import SPLITS, recordings
from studies.recordings.results import START, RecordingResults

ALL = "all"

MEASURED = measured(lambda index: index.origins, ONE_COLD_RUN)


@dataclass(frozen=True)
class Recordings(Results):
    """The folder of all recordings."""

    @cached_property
    def summaries(self) -> list[Row]:
        """What is told of every recording, in the order of the list."""
        return [RecordingResults(self.folder, name).summary() for name in recordings()]

    @property
    def origins(self) -> dict[str, Record]:
        """Provenance of every extraction."""
        each = (RecordingResults(self.folder, name) for name in recordings())
        return {results.name: results.run["provenance"] for results in each}

    @property
    def in_formats(self) -> str:
        """Name of the recording that is written in other formats."""
        return recordings()[RECORDING].title

    @property
    def start_seconds(self) -> float:
        """Time of the processor [s] that the start of the program takes."""
        seconds: float = self.read_json(START)["cpu_seconds"]
        return seconds


def clips(index: Recordings) -> Iterator[Row]:
    """One row for every recording."""
    yield from index.summaries


def groups(index: Recordings) -> Iterator[Row]:
    """Medians of all recordings, of each split, and within it of tonal ones and of each kind."""
    yield _group(ALL, ALL, index.summaries)
    for split in SPLITS:
        rows = [row for row in index.summaries if row["split"] == split]
        yield _group(split, ALL, rows)
        yield _group(split, "tonal", [row for row in rows if row["tonal"] == "yes"])
        for kind in sorted({row["kind"] for row in rows}):
            yield _group(split, kind, [row for row in rows if row["kind"] == kind])


def formats(index: Recordings) -> list[Row]:
    """A recording in other formats."""
    rows: list[Row] = index.read_json(FORMATS)
    return rows


def page(index: Recordings, tables: dict[str, Table]) -> str:
    """Build the page from its tables."""
    return rendered(
        "studies/recordings/index.html.j2",
        title="Extraction on real recordings",
        tables=tables,
        groups={row["split"]: row for row in tables["groups"].rows if row["kind"] == ALL},
    )


def _group(split: str, kind: str, rows: list[Row]) -> Row:
    found = [row for row in rows if not row["said"]]
    return {
        "split": split,
        "kind": kind,
        "clips": len(rows),
        "refused": len(rows) - len(found),
        "modes": _over(median, found, "modes"),
        "decibels": _over(median, found, "decibels"),
        "decibels_heard": _over(median, found, "decibels_heard"),
        "peaks": sum(row["peaks"] for row in found),
        "missed": sum(row["missed"] for row in found),
        "cpu_rate": _over(median, found, "cpu_rate"),
        "cpu_rate_most": _over(max, found, "cpu_rate"),
    }


def _over(reduce: Callable[[list[float]], float], rows: list[Row], key: str) -> float | None:
    """A number of a column; none if there are no rows."""
    return float(reduce([row[key] for row in rows])) if rows else None
