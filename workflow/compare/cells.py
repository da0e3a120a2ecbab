"""Numbers of two folders that belong together: same table, same row, same column."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from workflow.compare.folders import Folder
from workflow.compare.noise import SAME, UNJUDGED, Value, verdict
from workflow.report.numbers import MISSING, show
from workflow.report.table import KIND, LEAST, MOST, Column, Table, kind_in

Row = dict[str, Any]

APART = ("provenance",)
"""Tables that are told as conditions instead."""


@dataclass(frozen=True)
class Cell:
    """A number of both folders, and what became of it.

    Attributes
    ----------
    table, row, column, label
        Where it stands: path of the table, values of the columns that name the row, key of the
        column and its head for people.
    kind
        See `workflow.report.numbers.show`.
    before, now
        The baseline's and the other folder's.
    """

    table: str
    row: str
    column: str
    label: str
    kind: str
    before: Value
    now: Value

    @property
    def verdict(self) -> str:
        """What became of it, see `workflow.compare.noise`."""
        return verdict(self.kind, self.before, self.now)

    @property
    def moved(self) -> bool:
        """Whether it is not the same any more."""
        return self.verdict != SAME

    @property
    def ratio(self) -> float | None:
        """The number over that of the baseline; None where that says nothing."""
        old, new = self.before.value, self.now.value
        if isinstance(old, str) or isinstance(new, str) or not old or new is None:
            return None
        return new / old

    def shown(self, value: Value) -> str:
        """A value with its spread, for people."""
        text = show(value.value, self.kind)
        if value.spread is None:
            return text
        least, most = (show(end, self.kind) for end in value.spread)
        return f"{text} ({least} … {most})"


@dataclass(frozen=True)
class Comparison:
    """Everything that two folders have in common, and what only one of them has.

    Attributes
    ----------
    before, now : the baseline and the other folder.
    cells : numbers of both.
    only_before, only_now : tables, rows and columns of one folder alone, in words.
    """

    before: Folder
    now: Folder
    cells: list[Cell]
    only_before: list[str]
    only_now: list[str]

    @property
    def moved(self) -> list[Cell]:
        """Numbers that are not the same any more."""
        return [cell for cell in self.cells if cell.moved]


def compare(before: Folder, now: Folder) -> Comparison:
    """Set two folders side by side."""
    paths = [path for path in now.tables if path in before.tables and name_of(path) not in APART]
    cells = [cell for path in paths for cell in _cells(path, before.tables[path], now.tables[path])]
    return Comparison(
        before, now, cells, list(_only(before, now, paths)), list(_only(now, before, paths))
    )


def name_of(path: str) -> str:
    """Name of a table by its path."""
    return path.rpartition("/")[2]


def _cells(path: str, before: Table, now: Table) -> Iterator[Cell]:
    old_rows, known = _by_name(before), {column.key for column in before.columns}
    columns = [column for column in _judged(now) if column.key in known]
    labels = [column.label for column in columns]
    for name, row in _by_name(now).items():
        if name not in old_rows:
            continue
        old = old_rows[name]
        for column in columns:
            unique = labels.count(column.label) == 1
            yield Cell(
                path,
                name,
                column.key,
                column.label if unique else column.key,
                kind_in(row, column),
                _value(old, column.key),
                _value(row, column.key),
            )


def _judged(table: Table) -> list[Column]:
    """Columns with numbers and texts of their own, which are not what names the rows."""
    keys = {column.key for column in table.columns}
    about = {f"{key}{ending}" for key in keys for ending in (LEAST, MOST, KIND)}
    names = {*_keys(table), *about}
    return [
        column
        for column in table.columns
        if column.key not in names and column.kind not in UNJUDGED
    ]


def _keys(table: Table) -> list[str]:
    return table.keys or [table.columns[0].key]


def _by_name(table: Table) -> dict[str, Row]:
    """Rows by the values of the columns that name them."""
    found: dict[str, Row] = {}
    for row in table.rows:
        name = ", ".join(
            _word(row, column) for column in table.columns if column.key in _keys(table)
        )
        found[name] = row
    return found


def _word(row: Row, column: Column) -> str:
    value = row.get(column.key)
    return f"{column.key} {value}" if column.kind == "count" else str(value or MISSING)


def _value(row: Row, key: str) -> Value:
    return Value(row.get(key), row.get(f"{key}{LEAST}"), row.get(f"{key}{MOST}"))


def _only(here: Folder, there: Folder, shared: list[str]) -> Iterator[str]:
    """Tables, rows and columns that one folder has and the other has not."""
    yield from (f"table {path}" for path in here.tables if path not in there.tables)
    for path in shared:
        table, other = here.tables[path], there.tables[path]
        for name in _by_name(table):
            if name not in _by_name(other):
                yield f"{path}: row {name}"
        known = {column.key for column in other.columns}
        for column in table.columns:
            if column.key not in known:
                yield f"{path}: column {column.key}"
