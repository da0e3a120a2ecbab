"""Numbers of two folders that belong together: same table, same row, same column."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import pandas as pd

from workflow.studies.base.numbers import MISSING, show
from workflow.studies.base.table import KIND, MAX, MIN, Column, Table, kind_in
from workflow.studies.comparison.folders import Folder
from workflow.studies.comparison.noise import SAME, UNJUDGED, VERDICTS, Value, verdict

Row = dict[str, Any]

APART = ("provenance",)
"""Tables that are told as conditions instead."""
KEYS = ["table", "row", "column"]
SIDES = ("before", "now")
ENDS = ("", MIN, MAX)


@dataclass(frozen=True)
class Comparison:
    """Everything that two folders have in common, and what only one of them has.

    Attributes
    ----------
    before, now : the baseline and the other folder.
    cells : numbers of both: `KEYS`, `label` for people, `kind`, the values of both `SIDES` with
        their `ENDS`, the `ratio` of both where that says something, and the `verdict`.
    only_before, only_now : tables, rows and columns of one folder alone, in words.
    """

    before: Folder
    now: Folder
    cells: pd.DataFrame
    only_before: list[str]
    only_now: list[str]

    @property
    def moved(self) -> pd.DataFrame:
        """Numbers that are not the same any more, the worst first."""
        found = self.cells[self.cells["verdict"] != SAME]
        order = found["verdict"].map(VERDICTS.index)
        ratio = pd.to_numeric(found["ratio"]).fillna(1.0).abs().replace(0.0, 1.0)
        distance = -pd.concat([ratio, 1.0 / ratio], axis=1).max(axis=1)
        ranks = pd.DataFrame({"order": order, "distance": distance}).sort_values(
            ["order", "distance"], kind="stable"
        )
        return found.loc[ranks.index]


def compare(before: Folder, now: Folder) -> Comparison:
    """Set two folders side by side."""
    old, new = _numbers(before, "before"), _numbers(now, "now")
    cells = new.merge(old[[*KEYS, *(f"before{end}" for end in ENDS)]], on=KEYS)
    pairs = list(zip(*([_value(row, side) for row in cells.to_dict("records")] for side in SIDES)))
    cells["ratio"] = pd.Series([_ratio(*pair) for pair in pairs], dtype=object)
    found = [verdict(kind, *pair) for kind, pair in zip(cells["kind"], pairs)]
    cells["verdict"] = pd.Series(found, dtype=object)
    return Comparison(before, now, cells, list(_only(before, now)), list(_only(now, before)))


def shown(cell: Row, side: str) -> str:
    """A value with its spread, for people."""
    value = _value(cell, side)
    text = show(value.value, cell["kind"])
    if value.spread is None:
        return text
    low, high = (show(end, cell["kind"]) for end in value.spread)
    return f"{text} ({low} … {high})"


def name_of(path: str) -> str:
    """Name of a table by its path."""
    return path.rpartition("/")[2]


def _numbers(folder: Folder, side: str) -> pd.DataFrame:
    """All numbers of a folder, the values as columns of a side."""
    rows = [
        {
            **dict(zip(KEYS, (path, name, column.key))),
            "label": label,
            "kind": kind_in(row, column),
            **{f"{side}{end}": row.get(f"{column.key}{end}") for end in ENDS},
        }
        for path, table in folder.tables.items()
        if name_of(path) not in APART
        for name, row in _by_name(table).items()
        for column, label in _judged(table)
    ]
    names = [*KEYS, "label", "kind", *(f"{side}{end}" for end in ENDS)]
    return pd.DataFrame(rows, columns=names, dtype=object)


def _judged(table: Table) -> list[tuple[Column, str]]:
    """Columns with numbers and texts of their own, which are not what names the rows."""
    keys = {column.key for column in table.columns}
    names = {*_keys(table), *(f"{key}{end}" for key in keys for end in (MIN, MAX, KIND))}
    found = [each for each in table.columns if each.key not in names and each.kind not in UNJUDGED]
    labels = [column.label for column in found]
    return [
        (column, column.label if labels.count(column.label) == 1 else column.key)
        for column in found
    ]


def _keys(table: Table) -> list[str]:
    return table.keys or [table.columns[0].key]


def _by_name(table: Table) -> dict[str, Row]:
    """Rows by the values of the columns that name them."""
    named = [column for column in table.columns if column.key in _keys(table)]
    return {", ".join(_word(row, column) for column in named): row for row in table.rows}


def _word(row: Row, column: Column) -> str:
    value = row.get(column.key)
    return f"{column.key} {value}" if column.kind == "count" else str(value or MISSING)


def _value(cell: Row, side: str) -> Value:
    return Value(*(cell[f"{side}{end}"] for end in ENDS))


def _ratio(before: Value, now: Value) -> float | None:
    """A number over that of the baseline; None where that says nothing."""
    old, new = before.value, now.value
    if isinstance(old, str) or isinstance(new, str) or not old or new is None:
        return None
    return new / old


def _only(here: Folder, there: Folder) -> Iterator[str]:
    """Tables, rows and columns that one folder has and the other has not."""
    yield from (f"table {path}" for path in here.tables if path not in there.tables)
    for path, table in here.tables.items():
        if path in there.tables and name_of(path) not in APART:
            other = there.tables[path]
            known = {column.key for column in other.columns}
            rows = _by_name(other)
            yield from (f"{path}: row {name}" for name in _by_name(table) if name not in rows)
            yield from (f"{path}: column {c.key}" for c in table.columns if c.key not in known)
