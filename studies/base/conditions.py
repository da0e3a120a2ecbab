"""Under which conditions the numbers of a table were measured."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from studies.base.numbers import MISSING, show
from workflow import settings

Record = Mapping[str, Any]

LABELS = {
    "processor": "Processor",
    "compiled_for": "Compiled for",
    "vectors": "Vector registers",
    "cores": "Cores",
    "memory": "Memory",
    "ranks": "MPI ranks",
    "threads": "Threads of a rank",
    "blas": "BLAS",
    "versions": "Versions",
    "commit": "Commit",
    "configuration": "Hash of the configuration",
    "runs": "Runs",
    "spread": "Spread",
    "date": "Date",
    "differing": "Not the same for all rows",
}
"""Conditions for people, in the order in which they are shown."""

TOLD = ("processor", "compiled_for", "cores", "ranks", "threads", "blas", "commit")
"""Those that a record tells in the words that are shown."""

NAMED = 3
"""Rows that are named where conditions differ; the others are counted."""


class Conditions(dict[str, str]):
    """Where, when, with what and how often the numbers of a table were measured, in words.

    By the keys of `LABELS`: `cores` are those that the process could use, `compiled_for` is LLVM's
    name of the processor, `configuration` the hash of the resolved one whatever the folders,
    `differing` names those that are not the same for all rows, whose values are followed by theirs.
    """

    @property
    def texts(self) -> dict[str, str]:
        """Conditions by key, without `differing` where nothing differs."""
        return {key: text for key, text in self.items() if text}

    @property
    def headline(self) -> str:
        """Machine, ranks, runs and date in one line."""
        warning = "; not the same for all rows: {differing}" if self["differing"] else ""
        return (
            "{processor} ({compiled_for}, vectors of {vectors}), {cores} cores, {memory}; ranks "
            f"{{ranks}}, threads {{threads}}; runs {{runs}}; {{date}}{warning}"
        ).format(**self)

    def as_markdown(self) -> str:
        """All conditions as a paragraph."""
        texts = (f"{LABELS[key]}: {text}" for key, text in self.texts.items())
        return f"*Conditions.* {'; '.join(texts)}.\n"


@dataclass(frozen=True)
class Repeats:
    """How often something was measured, and how the spread of the runs is told."""

    runs: str
    spread: str


IN_COLUMNS = "min and max of the runs: columns ending in _min and _max of the CSV file"
ONE_COLD_RUN = Repeats("1, cold", "unknown, as of any single run")
NOT_TIMED = Repeats("1", "none, as nothing is timed; a repetition differs by rounding")


def conditions(
    records: Mapping[str, Record], config: Mapping[str, Any], repeats: Repeats, **said: str
) -> Conditions | None:
    """Conditions of a table from the provenance of its results; None if there are none.

    Parameters
    ----------
    records
        Provenance of each result, by the name of its rows.
    config
        The resolved configuration.
    said
        Conditions that the records do not tell, or not well.
    """
    if not records:
        return None
    texts_by_row = {name: _texts(record) for name, record in records.items()}
    keys = list(next(iter(texts_by_row.values())))
    values = {key: {name: texts[key] for name, texts in texts_by_row.items()} for key in keys}
    differing = [key for key in keys if key not in said and len(set(values[key].values())) > 1]
    texts = {
        **{key: _joined(by_row) for key, by_row in values.items()},
        "configuration": settings.config_hash(config),
        "runs": repeats.runs,
        "spread": repeats.spread,
        "date": _days(records),
        "differing": ", ".join(differing),
        **said,
    }
    return Conditions({key: texts[key] for key in LABELS})


def measured(
    records: Callable[[Any], Mapping[str, Record]],
    repeats: Repeats | Callable[[Any], Repeats],
    **said: str,
) -> Callable[[Any], Conditions | None]:
    """The conditions of a table as a function of the results, from which the records come."""

    def of_results(results: Any) -> Conditions | None:
        how = repeats(results) if callable(repeats) else repeats
        return conditions(records(results), results.config, how, **said)

    return of_results


def read_conditions(texts: Mapping[str, str]) -> Conditions | None:
    """Conditions from a table's file; None if it tells none."""
    known = {name: texts[name] for name in LABELS if name in texts}
    unknown = {**dict.fromkeys(LABELS, MISSING), "differing": ""}
    return Conditions({**unknown, **known}) if known else None


def versions_of(record: Record) -> str:
    """Packages and their versions in a line."""
    versions = json.loads(record.get("versions", "{}"))
    return ", ".join(f"{name} {version}" for name, version in versions.items())


def _texts(record: Record) -> dict[str, str]:
    return {
        **{key: str(record.get(key, MISSING)) for key in TOLD},
        "vectors": f"{record['vector_bits']} bits" if "vector_bits" in record else MISSING,
        "memory": show(record.get("memory_bytes"), "bytes"),
        "versions": versions_of(record) or MISSING,
    }


def _joined(by_row: Mapping[str, str]) -> str:
    """The text that all rows share, or every text with the rows that it holds for."""
    rows: dict[str, list[str]] = {}
    for row, text in by_row.items():
        rows.setdefault(text, []).append(row)
    if len(rows) == 1:
        return next(iter(rows))
    return "; ".join(f"{text} ({_named(names)})" for text, names in rows.items())


def _named(rows: list[str]) -> str:
    more = len(rows) - NAMED
    return ", ".join(rows[:NAMED]) + (f" and {more} more" if more > 0 else "")


def _days(records: Mapping[str, Record]) -> str:
    days = sorted({record["date"][:10] for record in records.values() if "date" in record})
    if not days:
        return MISSING
    return days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}"
