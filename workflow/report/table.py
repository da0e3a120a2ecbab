"""A table that is written once and read as CSV, Markdown or HTML."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from carillon.files import atomic_path
from workflow.report.numbers import show


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
        How values are formatted, see `workflow.report.numbers.show`.
    unit
        Unit of the raw value, written into the CSV's head.
    shown
        Whether people see the column; programs always do.
    """

    key: str
    label: str
    kind: str = "text"
    unit: str = ""
    shown: bool = True


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
    """

    name: str
    caption: str
    columns: list[Column]
    rows: list[dict[str, Any]] = field(default_factory=list)

    @property
    def shown(self) -> list[Column]:
        """Columns for people."""
        return [column for column in self.columns if column.shown]

    def cells(self, row: dict[str, Any]) -> list[str]:
        """A row as people read it."""
        return [show(row.get(column.key), column.kind) for column in self.shown]

    def as_csv(self) -> str:
        """Raw values, SI units in the head."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(
            f"{column.key} [{column.unit}]" if column.unit else column.key
            for column in self.columns
        )
        for row in self.rows:
            writer.writerow(_raw(row.get(column.key)) for column in self.columns)
        return text.getvalue()

    def as_markdown(self) -> str:
        """Formatted values below the caption."""
        heads = [column.label for column in self.shown]
        rules = ["---" if column.kind == "text" else "---:" for column in self.shown]
        lines = [heads, rules, *map(self.cells, self.rows)]
        return f"{self.caption}\n\n" + "".join(
            f"| {' | '.join(cell.replace('|', '/') for cell in line)} |\n" for line in lines
        )


def write_table(table: Table, folder: str | Path) -> None:
    """Write `table` to `folder` as CSV, Markdown and, for the report, JSON."""
    contents = {
        "csv": table.as_csv(),
        "md": table.as_markdown(),
        "json": json.dumps(asdict(table), indent=1),
    }
    for ending, text in contents.items():
        with atomic_path(Path(folder) / f"{table.name}.{ending}") as temporary:
            temporary.write_text(text)


def read_table(path: str | Path) -> Table:
    """Read a table back from its JSON file."""
    loaded = json.loads(Path(path).read_text())
    columns = [Column(**column) for column in loaded.pop("columns")]
    return Table(columns=columns, **loaded)


def _raw(value: Any) -> Any:
    if isinstance(value, (list, tuple)):
        return "..".join(str(part) for part in value)
    return value
