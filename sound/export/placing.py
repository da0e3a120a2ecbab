"""Files of an export get their places in a folder, where those of a former export make room."""

from __future__ import annotations

import json
import os
import re
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from carillon.errors import UserError
from carillon.files.held_folder import HeldFolder

SOUNDS = "sounds"
"""Name of the folder of sounds, and of the tables beside it."""
TABLE = f"{SOUNDS}.json"
"""Name of the table that lists the files of an export."""
FORMAT = "carillon sound set 1"
"""Name of the format of the table of sounds, in its key `format`."""
LARGEST_TABLE = 64 * 2**20
"""Length [bytes] of a table that is read."""

_OWN = re.compile(
    rf"{SOUNDS}/[a-z0-9_]+\.wav|[a-z0-9_]+\.(glb|dsp|js|impobj)|[a-z0-9_]+-modes\.(json|csv)"
    rf"|{SOUNDS}-wwise\.txt|{SOUNDS}\.(csv|json)"
)
"""Names of files that an export writes."""


def require_places(folder: HeldFolder, files: Sequence[str]) -> None:
    """Check that files `NAME` and `sounds/NAME` can be put into a folder.

    Raises UserError if something else than a file has one of the names, a link above all, or if
    `sounds` is no folder or may not be written to.
    """
    for parent, names in {SOUNDS: [], **_by_parent(files)}.items():
        with _inside(folder, parent) as inner:
            if inner is None:
                continue
            if not os.access(inner.path, os.W_OK):
                raise UserError(f"{inner.path}: cannot be written; name a folder you may write to")
            for name in names:
                inner.require_replaceable(name)


def place(folder: HeldFolder, staged: Path, files: Sequence[str]) -> list[str]:
    """Move files from a folder `staged` on the same disk to their places, in their order.

    Before that, files that the folder's table lists, and that are not among these, are removed; the
    list of these is returned.  Other files stay, and so does what is no regular file.  Signals that
    end the process wait until all files have their places.  Raises UserError as `require_places`
    does, before anything has changed.
    """
    require_places(folder, files)
    with _unstopped():
        removed = _removed(folder, [each for each in _former(folder) if each not in set(files)])
        for file in files:
            target = folder.path / file
            target.parent.mkdir(exist_ok=True)
            os.replace(staged / file, target)
    return removed


def _former(folder: HeldFolder) -> list[str]:
    """Files of a former export by its table, none if there is no such table."""
    try:
        table = json.loads(folder.read(TABLE, LARGEST_TABLE))
    except (UserError, ValueError, RecursionError):
        return []
    if not isinstance(table, dict) or table.get("format") != FORMAT:
        return []
    files = table.get("files")
    listed = files if isinstance(files, list) else []
    return [each for each in listed if isinstance(each, str) and _OWN.fullmatch(each)]


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
    """Names of files by the folder that they lie in: `SOUNDS`, or an empty text."""
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


@contextmanager
def _unstopped() -> Iterator[None]:
    """Signals that end the process wait until the end."""
    former = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, former)
