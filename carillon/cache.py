"""The user's cache: what was found once is not sought again.

Entries are named by a hash of all that they depend on, so none is ever out of date.  The cache
saves time and nothing else: what is damaged in it is made anew, and where it cannot be written,
everything is found every time.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

from carillon.errors import UserError

Found = TypeVar("Found")

PLACE = "CARILLON_CACHE"
"""Environment variable that names the folder in place of the user's own cache."""
MOST_BYTES = 1 << 28
"""Of all entries of a kind; those that were used least recently make room."""


def remembered(
    kind: str,
    key: str,
    find: Callable[[], Found],
    read: Callable[[Path], Found],
    write: Callable[[Path, Found], None],
) -> Found:
    """What `find` finds, or found before.

    Parameters
    ----------
    kind
        What is kept: the name of a folder in the cache.
    key
        Hash of all that the result depends on.
    find
        Called unless its result is in the cache.  What it raises is not kept.
    read, write
        Read and write an entry (HDF5).  Errors of the file are raised as UserError or OSError.
    """
    folder = folder_of(kind)
    path = folder / f"{key}.h5"
    with suppress(UserError, OSError):
        kept = read(path)
        os.utime(path)
        return kept
    found = find()
    if folder.is_absolute():  # else the user has no home
        with suppress(UserError, OSError):
            folder.mkdir(parents=True, exist_ok=True)
            write(path, found)
            _make_room(folder)
    return found


def folder_of(kind: str) -> Path:
    """Where entries of a kind are kept."""
    from platformdirs import user_cache_path

    named = os.environ.get(PLACE)
    return (Path(named).absolute() if named else user_cache_path("carillon")) / kind


def _make_room(folder: Path) -> None:
    """Remove the entries used least recently, until the others take no more than `MOST_BYTES`."""
    entries = [(path, path.stat()) for path in folder.glob("*.h5")]
    size = sum(status.st_size for _, status in entries)
    for path, status in sorted(entries, key=lambda entry: entry[1].st_mtime_ns):
        if size <= MOST_BYTES:
            return
        path.unlink(missing_ok=True)
        size -= status.st_size
