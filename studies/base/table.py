"""A table that is written once and read as CSV, Markdown or HTML.

The CSV file begins with lines `# key: value`: which columns tell rows apart, of what kind each
column is, and under which conditions the numbers were measured. Readers skip them as comments, for
instance `pandas.read_csv(path, comment="#")`. Where a number was measured several times, the
columns `NAME_min` and `NAME_max` hold the spread of the column `NAME`; a column `NAME_kind` says
of what kind the values of `NAME` are, row by row.
"""

import csv
import io
import json
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from itertools import takewhile
from pathlib import Path
from string import Formatter
from typing import Any

from carillon.files.atomic import atomic_path
from studies.base.conditions import Conditions, read_conditions
from studies.base.numbers import KINDS, show

MIN, MAX, KIND, MARK = "_min", "_max", "_kind", "_mark"
"""Endings of columns that tell something about another column."""
COMMENT = "# "
UNITS = {"seconds": "s", "modelled": "s", "bytes": "B", "hertz": "Hz", "angle": "rad"}
"""Units of kinds that always have the same one."""
_ABSENT = object()

Row = dict[str, Any]


@dataclass(frozen=True)
class Column:
    """One column."""

    key: str
    """Name in the rows and in the CSV file."""
    label: str
    """Head for people."""
    kind: str = "text"
    """How values are formatted, see `studies.base.numbers.show`."""
    unit: str = ""
    """Unit of the raw value, written into the CSV's head; that of the kind if empty."""
    shown: bool = True
    """Whether people see the column; programs always do."""
    source: str = field(default="", compare=False)
    """Where the value lies in what a table is made from, names joined by dots; the key if empty."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "unit", self.unit or UNITS.get(self.kind, ""))


def hidden(key: str, label: str, kind: str = "text", unit: str = "", source: str = "") -> Column:
    """A column for programs alone."""
    return Column(key, label, kind, unit, shown=False, source=source)


SOLID = (hidden("model", "Model"), Column("title", "Solid"))
"""Columns that name the solid of a row, see `solid`."""


def solid(results: Any, name: str) -> Row:
    """Values of the columns `SOLID`, from results that have `titles`."""
    return {"model": name, "title": results.titles[name]}


def spread(
    key: str, label: str, kind: str, unit: str = "", shown: bool = True, source: str = ""
) -> tuple[Column, ...]:
    """A column, and those of its smallest and largest value, which may be hidden.

    Examples
    --------
    >>> [column.key for column in spread("s", "Time", "seconds")]
    ['s', 's_min', 's_max']
    """
    ends = (Column(f"{key}{end}", end[1:], kind, unit, shown) for end in (MIN, MAX))
    return (Column(key, label, kind, unit, source=source), *ends)


def each(names: Iterable[str] | Mapping[str, str], *columns: Column) -> list[Column]:
    """These columns for each name; `{name}` and `{label}` in their texts are it and its label.

    Examples
    --------
    >>> both = each({"a": "First", "b": "Second"}, Column("{name}_s", "{label}, time"))
    >>> [(column.key, column.label) for column in both]
    [('a_s', 'First, time'), ('b_s', 'Second, time')]
    """
    labels = names if isinstance(names, Mapping) else {name: name for name in names}
    parts = ("key", "label", "source")
    return [
        replace(c, **{part: getattr(c, part).format(name=n, label=label) for part in parts})
        for n, label in labels.items()
        for c in columns
    ]


@dataclass(frozen=True)
class Table:
    """Rows of raw values with what is needed to show them."""

    name: str
    """File name without ending."""
    caption: str
    """What the table shows, over which modes, against which base."""
    columns: list[Column]
    rows: list[Row] = field(default_factory=list)
    """The rows are dictionaries by column key; a missing key is a missing value."""
    keys: list[str] = field(default_factory=list)
    """Columns that tell the rows apart; the first one if empty."""
    conditions: Conditions | None = None
    """Under which the numbers were measured; None if nothing says so."""

    @property
    def shown(self) -> list[Column]:
        """Columns for people."""
        return [column for column in self.columns if column.shown]

    def having(self, values: Mapping[str, Any]) -> list[Row]:
        """Rows that have these values."""
        return [row for row in self.rows if all(row.get(key) == values[key] for key in values)]

    def cells(self, row: Row) -> list[str]:
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


def kind_in(row: Row, column: Column) -> str:
    """Kind of a column's value in a row."""
    return row.get(f"{column.key}{KIND}") or column.kind


Columns = Column | Iterable[Column] | Callable[[Any], Iterable[Column]]
"""A column, several, or a function of the results that returns them."""


@dataclass(frozen=True)
class Tabulation:
    """How a table is made from results, see `table`."""

    name: str
    rows: Callable[[Any], Iterable[Row]]
    fields: Mapping[str, Any]
    columns: Sequence[Columns]
    keys: str = ""
    conditions: Callable[[Any], Conditions | None] | None = None

    def __call__(self, results: Any) -> Table:
        """Make the table, its name behind the `prefix` of the results if they have one."""
        caption = _Caption().format(self.rows.__doc__ or "", results, **self.fields)
        given = [part(results) if callable(part) else part for part in self.columns]
        columns = [c for part in given for c in ([part] if isinstance(part, Column) else part)]
        return Table(
            f"{getattr(results, 'prefix', '')}{self.name}",
            re.sub(r"\s*\n\s*", " ", caption).strip(),
            columns,
            [_picked(row, columns) for row in self.rows(results)],
            self.keys.split(),
            self.conditions(results) if self.conditions else None,
        )


def table(
    *columns: Columns,
    keys: str = "",
    conditions: Callable[[Any], Conditions | None] | None = None,
    name: str = "",
    **fields: Any,
) -> Callable[[Callable[[Any], Iterable[Row]]], Tabulation]:
    """Make a table of a function that yields its rows from results.

    Rows hold values by key or source; a column without its value is empty. The docstring of the
    function is the caption: what the table shows, over which modes, against which base. In its
    braces are attributes of the results, shown as of the kind that their format names.

    Parameters
    ----------
    keys
        Columns that tell the rows apart, the first one if there are none.
    conditions
        Says how the results were measured.
    name
        Of the table, that of the function if empty.
    fields
        What else the caption holds in braces: values, or functions of the results.
    """

    def of_rows(rows: Callable[[Any], Iterable[Row]]) -> Tabulation:
        own = name or rows.__name__.replace("_", "-")
        return Tabulation(own, rows, fields, columns, keys, conditions)

    return of_rows


class _Caption(Formatter):
    """Fields are those given, or attributes of the results; formats are kinds."""

    def get_value(self, key: int | str, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Any:
        field = kwargs[str(key)] if key in kwargs else getattr(args[0], str(key))
        return field(args[0]) if key in kwargs and callable(field) else field

    def format_field(self, value: Any, format_spec: str) -> str:
        return show(value, format_spec) if format_spec in KINDS else format(value, format_spec)


def _picked(row: Row, columns: Iterable[Column]) -> Row:
    values = {column.key: _value(row, column.source or column.key) for column in columns}
    return {key: value for key, value in values.items() if value is not _ABSENT}


def _value(row: Any, source: str) -> Any:
    if source in row:
        return row[source]
    first, _, rest = source.partition(".")
    return _value(row[first], rest) if rest and isinstance(row.get(first), dict) else _ABSENT


def write_table(table: Table, folder: str | Path) -> None:
    """Write `table` to `folder` as CSV, Markdown and, for the report, JSON."""
    content = asdict(table)
    for column in content["columns"]:
        del column["source"]
    contents = {
        "csv": table.as_csv(),
        "md": table.as_markdown(),
        "json": json.dumps(content, indent=1),
    }
    for ending, text in contents.items():
        with atomic_path(Path(folder) / f"{table.name}.{ending}") as temporary:
            temporary.write_text(text)


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
    row: Row = dict(zip((column.key for column in columns), texts, strict=True))
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
