"""A table that is written once and read as CSV, Markdown or HTML.

The CSV file begins with lines `# key: value`: which columns tell rows apart, of what kind each
column is, and under which conditions the numbers were measured. Readers skip them as comments, for
instance `pandas.read_csv(path, comment="#")`. Where a number was measured several times, the
columns `NAME_min` and `NAME_max` hold the spread of the column `NAME`; a column `NAME_kind` says
of what kind the values of `NAME` are, row by row.
"""

from __future__ import annotations

import csv
import io
import json
import re
from dataclasses import asdict, dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import Any

from carillon.files.atomic import atomic_path
from studies.base.conditions import Conditions, read_conditions
from studies.base.numbers import show

MIN, MAX, KIND = "_min", "_max", "_kind"
"""Endings of columns that tell something about another column."""
COMMENT = "# "
UNITS = {"seconds": "s", "modelled": "s", "bytes": "B", "hertz": "Hz", "angle": "rad"}
"""Units of kinds that always have the same one."""


@dataclass(frozen=True)
class Column:
    """One column.

    Attributes
    ----------
    key
        Name in the rows and in the CSV file.
    label
        Head for people.
    kind
        How values are formatted, see `studies.base.numbers.show`.
    unit
        Unit of the raw value, written into the CSV's head.
    shown
        Whether people see the column; programs always do.
    source
        Where the value lies in what a table is made from, names joined by dots; the key if empty.
    """

    key: str
    label: str
    kind: str = "text"
    unit: str = ""
    shown: bool = True
    source: str = field(default="", compare=False)


def columns_of(text: str) -> list[Column]:
    """Columns from a text with a line a column, its parts two blanks or more apart.

    They are the key, the label, and at will the kind, a unit in brackets, and `hidden`.
    `KEY=SOURCE` says where the value lies. With `spread` the columns for the smallest and largest
    value follow, hidden ones with `spread-hidden`.

    Examples
    --------
    >>> [column.key for column in columns_of("solid  Solid\\ns=time  Time  seconds  spread")]
    ['solid', 's', 's_min', 's_max']
    """
    lines = filter(None, map(str.strip, text.splitlines()))
    return [column for line in lines for column in _columns_in(line)]


def _columns_in(line: str) -> list[Column]:
    name, label, *rest = re.split(r" {2,}", line)
    key, _, source = name.partition("=")
    words = " ".join(rest).split()
    unit = next((word[1:-1] for word in words if word.startswith("[")), "")
    flags = {"hidden", "spread", "spread-hidden"}.intersection(words)
    kind = next((word for word in words if not word.startswith("[") and word not in flags), "text")
    unit = unit or UNITS.get(kind, "")
    first = Column(key, label, kind, unit, "hidden" not in flags, source)
    if not flags - {"hidden"}:
        return [first]
    shown = "spread" in flags
    ends = (Column(f"{key}{end}", end[1:], kind, unit, shown) for end in (MIN, MAX))
    return [first, *ends]


@dataclass(frozen=True)
class Table:
    """Rows of raw values with what is needed to show them.

    Attributes
    ----------
    name
        File name without ending.
    caption
        What the table shows, over which modes, against which base.
    columns, rows
        The rows are dictionaries by column key; a missing key is a missing value.
    keys
        Columns that tell the rows apart; the first one if empty.
    conditions
        Under which the numbers were measured; None if nothing says so.
    """

    name: str
    caption: str
    columns: list[Column]
    rows: list[dict[str, Any]] = field(default_factory=list)
    keys: list[str] = field(default_factory=list)
    conditions: Conditions | None = None

    @property
    def shown(self) -> list[Column]:
        """Columns for people."""
        return [column for column in self.columns if column.shown]

    def cells(self, row: dict[str, Any]) -> list[str]:
        """A row as people read it."""
        return [show(row.get(column.key), kind_in(row, column)) for column in self.shown]

    def as_csv(self) -> str:
        """Raw values, SI units in the head, below lines about the table."""
        about = {
            "keys": ", ".join(self.keys or [self.columns[0].key]),
            "kinds": ", ".join(column.kind for column in self.columns),
            **(self.conditions.texts if self.conditions else {}),
        }
        text = io.StringIO()
        text.writelines(f"{COMMENT}{key}: {value}\n" for key, value in about.items())
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(
            f"{column.key} [{column.unit}]" if column.unit else column.key
            for column in self.columns
        )
        for row in self.rows:
            writer.writerow(_raw(row.get(column.key)) for column in self.columns)
        return text.getvalue()

    def as_markdown(self) -> str:
        """Formatted values below the caption, and the conditions below them."""
        heads = [column.label for column in self.shown]
        rules = ["---" if column.kind == "text" else "---:" for column in self.shown]
        lines = [heads, rules, *map(self.cells, self.rows)]
        table = "".join(
            f"| {' | '.join(cell.replace('|', '/') for cell in line)} |\n" for line in lines
        )
        below = f"\n{self.conditions.as_markdown()}" if self.conditions else ""
        return f"{self.caption}\n\n{table}{below}"


def kind_in(row: dict[str, Any], column: Column) -> str:
    """Kind of a column's value in a row."""
    return row.get(f"{column.key}{KIND}") or column.kind


def write_table(table: Table, folder: str | Path) -> None:
    """Write `table` to `folder` as CSV, Markdown and, for the report, JSON."""
    contents = {
        "csv": table.as_csv(),
        "md": table.as_markdown(),
        "json": json.dumps(_as_json(table), indent=1),
    }
    for ending, text in contents.items():
        with atomic_path(Path(folder) / f"{table.name}.{ending}") as temporary:
            temporary.write_text(text)


def _as_json(table: Table) -> dict[str, Any]:
    content = asdict(table)
    for column in content["columns"]:
        del column["source"]
    return content


def read_table(path: str | Path) -> Table:
    """Read a table back from its JSON file."""
    loaded = json.loads(Path(path).read_text())
    columns = [Column(**column) for column in loaded.pop("columns")]
    conditions = read_conditions(loaded.pop("conditions", None) or {})
    return Table(columns=columns, conditions=conditions, **loaded)


def read_csv_table(path: str | Path) -> Table:
    """Read a table back from its CSV file, which has neither caption nor labels."""
    lines = Path(path).read_text().splitlines()
    comments = list(takewhile(lambda line: line.startswith(COMMENT), lines))
    about = dict(line.removeprefix(COMMENT).split(": ", 1) for line in comments)
    heads, *rows = csv.reader(lines[len(comments) :])
    kinds = about["kinds"].split(", ")
    columns = [_column_of(head, kind) for head, kind in zip(heads, kinds, strict=True)]
    return Table(
        Path(path).stem,
        "",
        columns,
        [_row_of(columns, row) for row in rows],
        about["keys"].split(", "),
        read_conditions(about),
    )


def _column_of(head: str, kind: str) -> Column:
    key, _, unit = head.partition(" [")
    return Column(key, key, kind, unit.removesuffix("]"))


def _row_of(columns: list[Column], texts: list[str]) -> dict[str, Any]:
    row: dict[str, Any] = dict(zip((column.key for column in columns), texts, strict=True))
    return {column.key: _value_of(row[column.key], kind_in(row, column)) for column in columns}


def _value_of(text: str, kind: str) -> Any:
    if not text:
        return None
    if kind in ("text", "range"):
        return text
    return int(text) if text.isdigit() else float(text)


def _raw(value: Any) -> Any:
    if isinstance(value, (list, tuple)):
        return "..".join(str(part) for part in value)
    return value
