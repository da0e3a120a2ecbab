"""The values of a table, a row each, by which two tables are merged."""

from typing import Any

from studies.base.numbers import MISSING, show
from studies.base.table import KIND, MAX, MIN, Column, Row, Table, kind_in
from studies.comparison.noise import UNJUDGED, Value, verdict

KEYS = ["table", "row", "column"]
ENDS = ("", MIN, MAX)
SHOWN = "_shown"
"""Ending of a value with its spread, for people."""


def rows_of(table: Table) -> dict[str, Row]:
    """The rows by their names."""
    keys = table.keys or [table.columns[0].key]
    named = [column for column in table.columns if column.key in keys]
    if len(named) < len(set(keys)):
        raise KeyError(keys)
    return {", ".join(_word(row, column) for column in named): row for row in table.rows}


def cells_of(path: str, table: Table) -> list[tuple[Any, ...]]:
    """All values: `KEYS`, label for people, kind, those of `ENDS` and `SHOWN`.

    The label is None where a value is not compared. Every value is shown and judged once, so that
    one which is none of its kind raises.
    """
    labels = _labels(table)
    return [
        (path, name, column.key, labels.get(column.key), *_cell(row, column))
        for name, row in rows_of(table).items()
        for column in table.columns
    ]


def _cell(row: Row, column: Column) -> tuple[Any, ...]:
    kind, value = kind_in(row, column), Value(*(row.get(f"{column.key}{end}") for end in ENDS))
    verdict(kind, value, value)
    shown = show(value.value, kind)
    if value.spread is not None:
        shown += f" ({' … '.join(show(end, kind) for end in value.spread)})"
    return kind, *value, shown


def _labels(table: Table) -> dict[str, str]:
    """Labels by key of columns with values of their own, which are not what names the rows."""
    about = {f"{column.key}{end}" for column in table.columns for end in (MIN, MAX, KIND)}
    about.update(table.keys or [table.columns[0].key])
    judged = {
        column.key: column.label
        for column in table.columns
        if column.key not in about and column.kind not in UNJUDGED
    }
    labels = list(judged.values())
    return {key: label if labels.count(label) == 1 else key for key, label in judged.items()}


def _word(row: Row, column: Column) -> str:
    value = row.get(column.key)
    return f"{column.key} {value}" if column.kind == "count" else str(value or MISSING)
