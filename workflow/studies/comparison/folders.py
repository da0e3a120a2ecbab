"""The tables and the configuration that a folder of results holds."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from carillon.documents import read_yaml
from carillon.errors import UserError
from carillon.files import cause
from carillon.places import require_file
from workflow.studies.base.numbers import show
from workflow.studies.base.table import Table, kind_in, read_csv_table, read_table
from workflow.studies.comparison.noise import Value, verdict

PARTS = ("tables", "paper/tables", "forests_study/tables")
"""Folders of tables below a folder of results."""
READERS = {".json": read_table, ".csv": read_csv_table}
"""How a table is read, by the ending of its file; the first file that exists counts."""
_SENSELESS = (
    *(ValueError, KeyError, TypeError, AttributeError, IndexError, OverflowError),
    *(RecursionError, csv.Error),
)
"""What a file that is no table leads to."""


@dataclass(frozen=True)
class Folder:
    """What is compared of a folder of results.

    Attributes
    ----------
    path : of the folder.
    tables : by their path below the folder, without ending.
    config : the resolved configuration; empty if the folder has none.
    """

    path: Path
    tables: dict[str, Table]
    config: dict[str, Any] = field(default_factory=dict)


def read_folder(path: str | Path) -> Folder:
    """Read all tables of a folder of results.

    Raises
    ------
    UserError
        If there is no such folder, if it holds no tables, or if one cannot be read.
    """
    path = require_tables(path)
    config = path / "config.yaml"
    return Folder(
        path,
        {str(stem.relative_to(path)): _read(stem) for stem in _stems(path)},
        read_yaml(config, "the configuration of a run") if config.exists() else {},
    )


def require_tables(path: str | Path) -> Path:
    """Check that a folder holds tables.

    Raises
    ------
    UserError
        If it does not, or does not exist.
    """
    path = Path(path)
    try:
        is_folder, stems = path.is_dir(), _stems(path)
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({cause(error)}), expected results") from None
    if not is_folder:
        raise UserError(f"{path}: there is no such folder, expected one with the results of a run")
    if not stems:
        raise UserError(
            f"{path}: holds no tables, expected {PARTS[0]}/*.json or {PARTS[0]}/*.csv as a run or "
            "the target reference leaves them"
        )
    return path


def require_apart(out: str | Path, *compared: Folder) -> Path:
    """Check that a comparison is not written among the tables compared, one of which it would be.

    Raises
    ------
    UserError
        If it is.
    """
    out = Path(out)
    if out.resolve() in {(folder.path / part).resolve() for folder in compared for part in PARTS}:
        raise UserError(f"{out}: holds tables that are compared; name another folder to write to")
    return out


def require_baseline(config: Mapping[str, Any]) -> list[str]:
    """Check before anything runs that a configuration names a baseline, for the rule's input.

    Returns
    -------
    No files: they may be those of the rule `reference`, which must not be made anew for this.

    Raises
    ------
    UserError
        If the configuration names none.
    """
    if not config["baseline"]:
        raise UserError("baseline: names no folder, run with --config baseline=FOLDER")
    return []


def _stems(path: Path) -> list[Path]:
    """Files of tables without their endings, each once."""
    files = (file for part in PARTS for file in sorted((path / part).glob("*")))
    return list(
        dict.fromkeys(
            file.with_suffix("") for file in files if file.suffix in READERS and file.exists()
        )
    )


def _read(stem: Path) -> Table:
    for ending, read in READERS.items():
        file = stem.with_suffix(ending)
        if file.exists():
            require_file(file, "a table")
            try:
                table = read(file)
                _try(table)
            except OSError as error:
                raise UserError(f"{file}: cannot be read ({cause(error)})") from None
            except _SENSELESS:
                raise UserError(
                    f"{file}: is no table of this version, or damaged; run the workflow again"
                ) from None
            return table
    raise FileNotFoundError(stem)


def _try(table: Table) -> None:
    """Do once with every value what a comparison does; what is no value of its kind raises."""
    if table.conditions is not None:
        "".join(table.conditions.told.values())
    ", ".join([table.name, *table.keys, *(column.label for column in table.columns)])
    known = {column.key for column in table.columns}
    if not known or not known.issuperset(table.keys):
        raise KeyError(table.keys)
    for row in table.rows:
        for column in table.columns:
            kind, value = kind_in(row, column), Value(row.get(column.key))
            show(value.value, kind)
            verdict(kind, value, value)
