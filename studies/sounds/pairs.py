"""Tables of the pairs of a recording and a solid that are designed with all defaults."""

from collections.abc import Callable, Iterator
from statistics import median, median_low
from typing import Any

import numpy as np

from sound.design.pitch import cents
from sound.rendering.likeness import (
    LIKE_CENTS,
    LIKE_DECIBELS,
    LIKE_RATIO,
    NEARER_DECIBELS,
)
from sound.rendering.verdict import CANNOT
from studies.base.conditions import ONE_COLD_RUN, Conditions, measured
from studies.base.table import Column, Row, hidden, table
from studies.sounds.index import OfClips
from studies.sounds.results import SoundResults

FIGURES = (
    Column("heard", "Partials heard", "count"),
    Column("taken", "taken", "count"),
    Column("left_out", "left out", "count"),
    Column("median_cents", "Median error [cents]", "fraction", "cents"),
    Column("worst_cents", "worst [cents]", "fraction", "cents"),
    Column("distance_db", "Distance [dB]", "fraction", "dB"),
    Column("silence_db", "of silence [dB]", "fraction", "dB"),
    Column("decay_ratio", "Decay over the clip’s", "fraction"),
    Column("word", "Verdict"),
    Column("reason", "Reason"),
    Column("goals", "Goals"),
    Column("seconds", "Processor time", "seconds"),
)


def _measured(listed: str) -> Callable[[OfClips], Conditions | None]:
    """Conditions of the designs of a list of the results."""
    return measured(
        lambda results: {each.name: each.design.provenance for each in getattr(results, listed)},
        ONE_COLD_RUN,
    )


@table(
    hidden("pair", "Pair"),
    Column("title", "Recording on solid"),
    *FIGURES,
    conditions=_measured("examples"),
    cents=LIKE_CENTS,
    decibels=LIKE_DECIBELS,
    nearer=NEARER_DECIBELS,
    ratio=LIKE_RATIO,
)
def pairs(results: OfClips) -> Iterator[Row]:
    """Designs with all defaults. Partials are those of the recording that are heard, those that the
    design takes, and those that no mode of the solid can have; errors are those of the taken ones
    on the fine solid. Distance is the log-spectral one of the rendered strike, modes and noise,
    from the recording, as the verdict on the design has it. Goals: a median error of {cents:count}
    cents at most, a distance of {nearer:count} dB less than that of silence at least, a decay
    within a factor {ratio}, or a verdict that says it cannot; over all pairs a median distance of
    {decibels:count} dB at most. The last row has the medians, of counts the lower one."""
    rows = [
        {"pair": each.name, "title": each.example.title, **_row(each)} for each in results.examples
    ]
    yield from rows
    yield _medians(rows)


@table(
    Column("seed", "Seed", "text"),
    *FIGURES,
    conditions=_measured("seeded"),
)
def seeds(results: OfClips) -> Iterator[Row]:
    """The pair {config[sound][seeded_clip]} by seeds of the search, all else as above; the last row
    has the medians."""
    rows = [
        {"seed": str(each.design.settings["optimiser"]["seed"]), **_row(each)}
        for each in results.seeded
    ]
    yield from rows
    yield {**_medians(rows), "seed": "median"}


def _row(results: SoundResults) -> Row:
    design, targets = results.design, results.design.targets
    which, left_out = targets.sounding, targets.left_out
    off = np.abs(cents(design.frequencies, targets.frequencies)[which])
    # Modes of one frequency share a partial.
    taken = len(np.unique(targets.frequencies[which]))
    without = 0 if left_out is None else len(left_out)
    verdict = design.evidence.get("verdict") or {"likeness": [{}]}
    row = {
        "heard": taken + without,
        "taken": taken,
        "left_out": without,
        "median_cents": float(np.median(off)),
        "worst_cents": float(off.max()),
        "seconds": float(design.evidence["seconds"]),
        **verdict,
        **verdict["likeness"][0],
    }
    return row | _goals(row, row.get("silence_db", 0.0) - NEARER_DECIBELS)


def _medians(rows: list[Row]) -> Row:
    values: dict[str, Any] = {}
    for key in (column.key for column in FIGURES if column.kind != "text"):
        there = [row[key] for row in rows if key in row]
        counts = all(isinstance(each, int) for each in there)
        if there:
            values[key] = (median_low if counts else median)(there)
    words = [row["word"] for row in rows if "word" in row]
    counted = ", ".join(f"{words.count(word)} {word}" for word in dict.fromkeys(words))
    row = {"pair": "median", "title": "Median", "word": counted, "reason": "", **values}
    return row | _goals(row, LIKE_DECIBELS)


def _goals(row: Row, most_decibels: float) -> Row:
    """Which goals a row misses; nothing without a verdict."""
    if not row.get("word"):
        return {}
    if row["word"] == CANNOT:
        return {"goals": "says it cannot"}
    missed = {
        "error": row["median_cents"] > LIKE_CENTS,
        "distance": row["distance_db"] > most_decibels,
        "decay": not 1.0 / LIKE_RATIO <= row["decay_ratio"] <= LIKE_RATIO,
    }
    names = ", ".join(name for name in missed if missed[name])
    return {"goals": f"missed: {names}" if names else "met"}
