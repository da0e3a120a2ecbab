"""Where result files come from, as they tell it: command, commit, versions, machine, date."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from carillon.builtin_names import BUILTIN_PREFIX
from carillon.errors import UserError, as_text
from carillon.fem.materials import NAMES as MATERIALS
from carillon.files.hdf5 import kind_of, open_h5
from carillon.records import provenance

INPUTS = ("mesh", "material", "regions", "forest")
"""Parameters of commands that may name a file."""
MOST_BYTES = 1 << 26
"""Longest JSON file that is searched for a record."""


@dataclass(frozen=True)
class Origin:
    """The record that a program has written into a result."""

    command: str
    commit: str
    versions: tuple[tuple[str, str], ...]
    """Packages with their versions, Carillon and Python first."""
    machine: str
    """Processor and BLAS."""
    date: str | None
    """ISO 8601; None where the record has none."""
    inputs: tuple[str, ...]
    """Files that the result was made from, as the command named them."""


def origin_of(path: Path) -> Origin | None:
    """The record in an HDF5 or JSON file; None where there is none.

    Raises UserError if the file is HDF5 and damaged, or cannot be read.
    """
    if path.suffix == ".h5":
        return _origin(_record_of_h5(path))
    if path.suffix == ".json" and path.stat().st_size <= MOST_BYTES:
        return _origin(_record_of_json(path))
    return None


def _record_of_h5(path: Path) -> Any:
    kind, schema = kind_of(path, "a result file (HDF5)")
    if not kind:
        raise UserError(f"{path}: is damaged or no HDF5 file of this project; make it again")
    with open_h5(path, kind, schema) as file:
        return provenance.read(file)


def _record_of_json(path: Path) -> Any:
    try:
        document = json.loads(path.read_text())
    except (ValueError, RecursionError):
        return None
    return document.get("provenance") if isinstance(document, dict) else None


def _origin(record: Any) -> Origin | None:
    if not isinstance(record, Mapping):
        return None
    try:
        versions = json.loads(record["versions"])
        parameters = json.loads(record["parameters"])
        named = [parameters.get(key) for key in INPUTS]
        return Origin(
            command=unicode_of(record["command"]),
            commit=unicode_of(record["commit"]),
            versions=tuple((unicode_of(name), unicode_of(each)) for name, each in versions.items()),
            machine=unicode_of(f"{record['processor']}, {record['blas']}"),
            date=unicode_of(record["date"]) if "date" in record else None,
            inputs=tuple(each for each in named if isinstance(each, str) and _is_file(each)),
        )
    except (LookupError, TypeError, ValueError, AttributeError):
        return None


def unicode_of(value: object) -> str:
    r"""A value as text that UTF-8 can hold: what is none, as in names of files, is escaped.

    Examples
    --------
    >>> print(unicode_of("d\udcff/bell.obj"))
    d\udcff/bell.obj
    """
    return as_text(str(value))


def _is_file(name: str) -> bool:
    """Whether a parameter is the path of a file, and not the name of something built in."""
    return name not in MATERIALS and not name.startswith(BUILTIN_PREFIX)
