"""Files of an export get their places in a folder, where those of a former export make room."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from carillon.errors import UserError
from carillon.files.held_folder import HeldFolder
from carillon.files.paths import cause, require_plain
from carillon.processes.signals import endings_held_back

LARGEST_TABLE = 64 * 2**20
"""Length [bytes] of a table that is read."""
STAGING = ".carillon-export-"
"""Beginning of the name of the folder in which all is written before it gets its place."""


@dataclass(frozen=True)
class FileTable:
    """The table (JSON) by which an export into a folder knows the files of a former one.

    Its key `files` lists them, as names in the folder.
    """

    name: str
    format: str
    """What its key `format` says."""
    own: re.Pattern[str]
    """Names of files that an export writes: others are not removed, though listed."""
    folder: str = ""
    """Name of a folder in the folder, in which files lie too; none if empty."""


@dataclass(frozen=True)
class Filling:
    """A folder that is being filled: files are written into `staged` first."""

    staged: Path
    _folder: HeldFolder
    _table: FileTable

    def place(self, files: Sequence[str]) -> list[str]:
        """Move files to their places, in their order, and remove those of a former export.

        These are files that the folder's table lists, and that are not among `files`; the list of
        them is returned. Other files stay, and so does what is no regular file. Signals that end
        the process wait until all files have their places. Raises UserError, before anything has
        changed, if something else than a file has one of the names, a link above all.
        """
        folder = self._folder
        _require_places(folder, self._table, files)
        with endings_held_back():
            former = _former(folder, self._table)
            removed = _removed(folder, [each for each in former if each not in set(files)])
            for file in files:
                target = folder.path / file
                target.parent.mkdir(exist_ok=True)
                os.replace(self.staged / file, target)
        return removed


def require_folder(path: str | Path) -> Path:
    """Check, before the work, that a folder can be filled: it is there, or can be made.

    Raises UserError if it cannot.
    """
    path = Path(path)
    require_plain(path)
    if path.exists() and not path.is_dir():
        raise UserError(f"{path}: is there and is no folder; name another")
    parent = path if path.is_dir() else path.absolute().parent
    if not parent.is_dir():
        raise UserError(f"{path}: the folder {parent} does not exist; create it first")
    if not os.access(parent, os.W_OK):
        raise UserError(f"{path}: cannot be written; name a folder you may write to")
    return path


@contextmanager
def filling(path: str | Path, table: FileTable, certain: Sequence[str]) -> Iterator[Filling]:
    """Fill a folder, made if it is missing; it stays as it is until `Filling.place`.

    Raises UserError if it cannot be written, or if something else than a file has the name of one
    that is `certain` to be written.
    """
    path = require_folder(path)
    is_new = not path.exists()
    try:
        path.mkdir(exist_ok=True)
        folder = HeldFolder(path)
        try:
            folder.remove_passing(STAGING)
            _require_places(folder, table, certain)
            with folder.passing(STAGING) as staged:
                yield Filling(staged, folder, table)
        finally:
            folder.close()
            if is_new and not any(path.iterdir()):
                path.rmdir()
    except OSError as error:
        raise UserError(f"{path}: could not be written ({cause(error)})") from error


def _require_places(folder: HeldFolder, table: FileTable, files: Sequence[str]) -> None:
    """Check that files can be put into a folder, and into the one in it.

    Raises UserError if something else than a file has one of the names, a link above all, or if
    the folder in it is none or may not be written to.
    """
    for parent, names in {table.folder: [], **_by_parent(files)}.items():
        with _inside(folder, parent) as inner:
            if inner is None:
                continue
            if not os.access(inner.path, os.W_OK):
                raise UserError(f"{inner.path}: cannot be written; name a folder you may write to")
            for name in names:
                inner.require_replaceable(name)


def _former(folder: HeldFolder, table: FileTable) -> list[str]:
    """Files of a former export by its table, none if there is no such table."""
    try:
        content = json.loads(folder.read(table.name, LARGEST_TABLE))
    except (UserError, ValueError, RecursionError):
        return []
    if not isinstance(content, dict) or content.get("format") != table.format:
        return []
    files = content.get("files")
    listed = files if isinstance(files, list) else []
    return [each for each in listed if isinstance(each, str) and table.own.fullmatch(each)]


def _removed(folder: HeldFolder, files: Sequence[str]) -> list[str]:
    """Remove files of a folder; the names of those that it had."""
    removed = []
    for parent, names in _by_parent(files).items():
        with _inside(folder, parent) as inner:
            if inner is None:
                continue
            for name in filter(inner.has_file, names):
                inner.remove(name)
                removed.append(f"{parent}/{name}".lstrip("/"))
    return removed


def _by_parent(files: Sequence[str]) -> dict[str, list[str]]:
    """Names of files by the name of the folder in it that they lie in; empty if in itself."""
    names: dict[str, list[str]] = {}
    for file in files:
        path = PurePosixPath(file)
        names.setdefault(str(path.parent).lstrip("."), []).append(path.name)
    return names


@contextmanager
def _inside(folder: HeldFolder, name: str) -> Iterator[HeldFolder | None]:
    """The folder itself, or one in it, or None if there is none of the name."""
    if not name:
        yield folder
    elif not folder.has(name):
        yield None
    else:
        inner = folder.child(name)
        try:
            yield inner
        finally:
            inner.close()
