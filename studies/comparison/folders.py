"""The tables and the configuration that a folder of results holds."""

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from carillon.errors import UserError
from carillon.files.paths import cause, require_file
from carillon.files.yaml_input import read_yaml
from studies.base.table import Table, read_csv_table, read_table
from studies.comparison.cells import cells_of

PARTS = ("tables", "paper/tables", "forests_study/tables")
"""Folders of tables below a folder of results."""
READERS = {".csv": read_csv_table, ".json": read_table}
"""Readers of tables by the ending of the file; the last file that exists counts."""
_SENSELESS = (
    *(ValueError, KeyError, TypeError, AttributeError, IndexError, OverflowError),
    *(RecursionError, csv.Error),
)
"""Exceptions on reading a file that is no table."""


@dataclass(frozen=True)
class Folder:
    """What is compared of a folder of results."""

    path: Path
    """Of the folder."""
    tables: dict[str, Table]
    """By their path below the folder, without ending."""
    config: dict[str, Any]
    """The resolved configuration; empty if the folder has none."""


def read_folder(path: str | Path) -> Folder:
    """Read all tables of a folder of results.

    Raises UserError if there is no such folder, if it holds no tables, or if one cannot be read.
    """
    path = Path(path)
    tables = {name: _read(file) for name, file in require_tables(path).items()}
    config = path / "config.yaml"
    values = read_yaml(config, "the configuration of a run") if config.exists() else {}
    return Folder(path, tables, values)


def require_tables(path: str | Path) -> dict[str, Path]:
    """Files of the tables in a folder, by their path below it without ending.

    Raises UserError if there are none, or there is no such folder.
    """
    path = Path(path)
    try:
        is_folder = path.is_dir()
        files = [file for part in PARTS for file in sorted((path / part).glob("*"))]
        files = [file for file in files if file.suffix in READERS and file.exists()]
    except OSError as error:
        raise UserError(f"{path}: cannot be read ({cause(error)}), expected results") from None
    if not is_folder:
        raise UserError(f"{path}: there is no such folder, expected one with the results of a run")
    if not files:
        raise UserError(
            f"{path}: holds no tables, expected {PARTS[0]}/*.json or {PARTS[0]}/*.csv as a run or "
            "the target reference leaves them"
        )
    return {str(file.relative_to(path).with_suffix("")): file for file in files}


def require_apart(out: str | Path, *compared: Folder) -> Path:
    """Check that a comparison is not written among the tables compared, one of which it would be.

    Raises UserError if it is.
    """
    out = Path(out)
    if out.resolve() in {(folder.path / part).resolve() for folder in compared for part in PARTS}:
        raise UserError(f"{out}: holds tables that are compared; name another folder to write to")
    return out


def _read(file: Path) -> Table:
    require_file(file, "a table")
    try:
        table = READERS[file.suffix](file)
        texts = table.conditions.texts.values() if table.conditions else ()
        # What is no text cannot be joined.
        "".join([table.name, *texts, *(column.label for column in table.columns)])
        cells_of("", table)
        return table
    except OSError as error:
        raise UserError(f"{file}: cannot be read ({cause(error)})") from None
    except _SENSELESS:
        raise UserError(
            f"{file}: is no table of this version, or damaged; run the workflow again"
        ) from None
