"""The values of a table, a row each, by which two tables are merged."""

from __future__ import annotations

import pandas as pd

from workflow.studies.base.entry import Row
from workflow.studies.base.numbers import MISSING, show
from workflow.studies.base.table import KIND, MAX, MIN, Column, Table, kind_in
from workflow.studies.comparison.noise import UNJUDGED, Value, verdict

KEYS = ["table", "row", "column"]
ENDS = ("", MIN, MAX)
SHOWN = "_shown"
"""Ending of a value with its spread, for people."""


def cells_of(path: str, table: Table) -> pd.DataFrame:
    """Values: `KEYS`, `kind`, a column for each of `ENDS` and `SHOWN`, and the `label`.

    The label is missing where a value is not compared. Every value is shown and judged once, so
    that one which is none of its kind raises.
    """
    keys = table.keys or [table.columns[0].key]
    named = [column for column in table.columns if column.key in keys]
    if len(named) < len(set(keys)):
        raise KeyError(keys)
    rows = {", ".join(_word(row, column) for column in named): row for row in table.rows}
    cells = [
        dict(zip(KEYS, (path, name, column.key))) | _cell(row, column)
        for name, row in rows.items()
        for column in table.columns
    ]
    frame = pd.DataFrame(cells, columns=[*KEYS, "kind", *ENDS, SHOWN], dtype=object)
    return frame.assign(label=frame["column"].map(_judged(table, keys)).astype(object))


def _cell(row: Row, column: Column) -> Row:
    kind, value = kind_in(row, column), Value(*(row.get(f"{column.key}{end}") for end in ENDS))
    verdict(kind, value, value)
    shown = show(value.value, kind)
    if value.spread is not None:
        shown += f" ({' … '.join(show(end, kind) for end in value.spread)})"
    return {"kind": kind, "": value.value, MIN: value.min, MAX: value.max, SHOWN: shown}


def _judged(table: Table, keys: list[str]) -> dict[str, str]:
    """Labels by key of columns with values of their own, which are not what names the rows."""
    about = {f"{column.key}{end}" for column in table.columns for end in (MIN, MAX, KIND)}
    compared = [
        column
        for column in table.columns
        if column.key not in about.union(keys) and column.kind not in UNJUDGED
    ]
    labels = [column.label for column in compared]
    return {
        column.key: column.label if labels.count(column.label) == 1 else column.key
        for column in compared
    }


def _word(row: Row, column: Column) -> str:
    value = row.get(column.key)
    return f"{column.key} {value}" if column.kind == "count" else str(value or MISSING)
