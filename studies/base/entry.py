"""A table of a study as one entry of the file `tables.yaml` of its package.

An entry is found by the table's name and says

    rows        the function `MODULE.NAME` of the package that yields the rows from the results,
    keys        the columns that tell the rows apart, the first one if there are none,
    conditions  the function of that module which says how the results were measured,
    caption     what the table shows, over which modes, against which base,
    columns     see `columns_of`,
    like        the package whose entry of the same name it takes over, but for what it says itself.

Caption and columns are templates: they see the `results` and all names of the module. Rows hold
values by key or source; a column without its value is empty.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from jinja2 import Environment, StrictUndefined

from carillon.files.yaml_input import read_own_yaml
from studies.base.numbers import show
from studies.base.table import Column, Table, columns_of

Row = dict[str, Any]
ROOT = Path(__file__).resolve().parent.parent.parent
_ABSENT = object()
_TEMPLATES = Environment(
    undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, autoescape=False
)
_TEMPLATES.filters["show"] = show


@dataclass(frozen=True)
class Entry:
    """A table, see above; `module` yields its rows."""

    name: str
    module: str
    rows: str
    columns: str
    caption: str = ""
    keys: str = ""
    conditions: str = ""

    def __call__(self, results: Any) -> Table:
        """Make the table, its name behind the `prefix` of the results if they have one."""
        names = vars(import_module(self.module))
        columns = columns_of(_rendered(self.columns, names, results))
        return Table(
            f"{getattr(results, 'prefix', '')}{self.name}",
            _rendered(self.caption, names, results),
            columns,
            [_picked(row, columns) for row in names[self.rows](results)],
            self.keys.split(),
            names[self.conditions](results) if self.conditions else None,
        )


def tables_of(package: str, file: str = "tables.yaml") -> dict[str, Entry]:
    """All entries of a file of a package by name."""
    entries = _read(package, file).items()
    return {name: _entry(name, {"package": package, **entry}) for name, entry in entries}


def descriptions(package: str, file: str = "tables.yaml") -> list[Path]:
    """The file, and those whose entries it takes over."""
    others = {entry["like"] for entry in _read(package, file).values() if "like" in entry}
    return [_path(package, file), *(_path(each, "tables.yaml") for each in sorted(others))]


def _path(package: str, file: str) -> Path:
    return ROOT.joinpath(*package.split("."), file)


@cache
def _read(package: str, file: str) -> dict[str, dict[str, str]]:
    return read_own_yaml(_path(package, file))


def _entry(name: str, entry: dict[str, str]) -> Entry:
    if "like" in entry:
        other = entry.pop("like")
        if "rows" not in entry:
            entry["package"] = other
        entry = _read(other, "tables.yaml")[name] | entry
    module, _, rows = entry.pop("rows").rpartition(".")
    return Entry(name, f"{entry.pop('package')}.{module}", rows, **entry)


def _rendered(text: str, names: Mapping[str, Any], results: Any) -> str:
    return _TEMPLATES.from_string(text).render({**names, "results": results}).strip()


def _picked(row: Row, columns: Iterable[Column]) -> Row:
    values = {column.key: _value(row, column.source or column.key) for column in columns}
    return {key: value for key, value in values.items() if value is not _ABSENT}


def _value(row: Any, source: str) -> Any:
    if source in row:
        return row[source]
    first, _, rest = source.partition(".")
    return _value(row[first], rest) if rest and isinstance(row.get(first), dict) else _ABSENT
