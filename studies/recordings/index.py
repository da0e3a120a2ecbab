"""The page that leads to the recordings, and the tables of all of them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from statistics import median

from studies.base.conditions import ONE_COLD_RUN, Record, measured
from studies.base.page import StudyPage, section
from studies.base.parts import grid, html, prose, tiles
from studies.base.results import Results
from studies.base.table import Column, Row, Table, hidden, table
from studies.recordings.formats import RECORDING
from studies.recordings.recordings import FORMATS, SPLITS, START, recordings
from studies.recordings.results import RecordingResults

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
        return self.read_json(START)["cpu_seconds"]


@table(
    hidden("name", "Recording"),
    Column("title", "Recording"),
    Column("kind", "Kind"),
    Column("tonal", "Tonal"),
    Column("split", "Split"),
    Column("seconds", "Length", "seconds"),
    Column("modes", "Modes", "count"),
    Column("decibels", "Explained [dB]", "fraction", "dB"),
    Column("explained", "Explained", "share"),
    Column("decibels_heard", "From 40 Hz on [dB]", "fraction", "dB"),
    Column("before", "Before", "share"),
    Column("peaks", "Strong peaks", "count"),
    Column("missed", "Missed", "count"),
    Column("cpu", "Processor time", "seconds"),
    Column("cpu_rate", "For a second of sound", "seconds"),
    Column("said", "Refused"),
    conditions=MEASURED,
)
def clips(index: Recordings) -> Iterator[Row]:
    """What extract finds in every recording. Explained: of the energy from where modes ring freely
    on; what comes before is a share of the whole clip's. Peaks are those of the spectrum within 40
    dB of the loudest and 15 dB above the median of what is around them, from 40 Hz to 0.45 of the
    sampling rate; missed are those that no mode is within 20 cents or half a line of. Processor
    time is that of the whole command, for a second of sound without its start
    ({start_seconds:seconds})."""
    yield from index.summaries


@table(
    Column("split", "Split"),
    Column("kind", "Kind"),
    Column("clips", "Recordings", "count"),
    Column("refused", "Refused", "count"),
    Column("modes", "Modes, median", "fraction"),
    Column("decibels", "Explained, median [dB]", "fraction", "dB"),
    Column("decibels_heard", "from 40 Hz on [dB]", "fraction", "dB"),
    Column("peaks", "Strong peaks", "count"),
    Column("missed", "Missed", "count"),
    Column("cpu_rate", "Processor time, median", "seconds"),
    Column("cpu_rate_most", "largest", "seconds"),
    keys="split kind",
    conditions=MEASURED,
)
def groups(index: Recordings) -> Iterator[Row]:
    """The same by split and kind: medians over the recordings that were not refused, sums of their
    peaks, and the processor time for a second of sound."""
    yield _group(ALL, ALL, index.summaries)
    for split in SPLITS:
        rows = [row for row in index.summaries if row["split"] == split]
        yield _group(split, ALL, rows)
        yield _group(split, "tonal", [row for row in rows if row["tonal"] == "yes"])
        for kind in sorted({row["kind"] for row in rows}):
            yield _group(split, kind, [row for row in rows if row["kind"] == kind])


@table(
    Column("format", "Written as"),
    Column("modes", "Modes", "count"),
    Column("strong", "Looked for", "count"),
    Column("same", "Found again", "count"),
    Column("median_cents", "Median [cents]", "small", "cents"),
    Column("worst_cents", "Largest [cents]", "small", "cents"),
    Column("explained", "Explained", "share"),
    Column("said", "Refused"),
)
def formats(index: Recordings) -> list[Row]:
    """The recording {in_formats} in other formats, the channel that is searched: how many of its
    modes below 8 kHz and within 40 dB of the loudest are found again within a cent, and how far the
    nearest mode is."""
    rows: list[Row] = index.read_json(FORMATS)
    return rows


def page(index: Recordings, tables: dict[str, Table]) -> StudyPage:
    """Build the page from its tables."""
    sentences = [
        (
            html("{decibels:fraction} dB", **row),
            html(
                """<b>{}</b>: explained in the median of {clips} recordings; {missed:count} of
                {peaks:count} strong peaks missed, {refused} clips refused""",
                row["split"].capitalize(),
                **row,
            ),
            "proof",
        )
        for row in tables["groups"].having({"kind": ALL})
    ]
    led = (html('<a href="{name}/page.html">{title}</a>', **row) for row in tables["clips"].rows)
    return StudyPage(
        title="Extraction on real recordings",
        kicker="extraction of modes",
        lede="""Real strikes, with noise, rooms and compressors in them: how much of each do damped
            sinusoids explain?""",
        sections=[
            section("Result", tiles(*sentences), grid(tables["groups"], by="split")),
            section(
                "Recordings",
                prose(html("Spectra, sounds and modes of {}.", html(", ").join(led))),
                grid(tables["clips"], by="split"),
                id="clips",
            ),
            section("Formats", grid(tables["formats"])),
        ],
        footer=html("""This page holds its numbers; its tables are also files in
            <span class="file">tables/</span> beside it."""),
    )


def _group(split: str, kind: str, rows: list[Row]) -> Row:
    found = [row for row in rows if not row["said"]]

    def over(reduce: Callable[[list[float]], float], key: str) -> float | None:
        return float(reduce([row[key] for row in found])) if found else None

    return {
        "split": split,
        "kind": kind,
        "clips": len(rows),
        "refused": len(rows) - len(found),
        **{key: over(median, key) for key in ("modes", "decibels", "decibels_heard", "cpu_rate")},
        **{key: sum(row[key] for row in found) for key in ("peaks", "missed")},
        "cpu_rate_most": over(max, "cpu_rate"),
    }
