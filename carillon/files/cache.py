"""The user's cache: what was found once is not sought again.

Entries are named by a hash of all that they depend on, so none is ever out of date.  The cache
saves time and nothing else: what is damaged in it is made anew, and where it cannot be written,
everything is found every time. Nothing of another user's is read, nor what others can write: an
entry is as good as a result that nobody checks again.
"""

import os
import stat
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TypeVar

from carillon.errors import UserError
from carillon.files.paths import is_own

Found = TypeVar("Found")

PLACE = "CARILLON_CACHE"
"""Environment variable that names the folder in place of the user's own cache."""
MOST_BYTES = 1 << 28
"""Most bytes of all entries of a kind; the least recently used ones make room."""


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
        Read and write an entry (HDF5).  Errors of the file are raised as UserError or OSError;
        what is read is checked as if a user had given it.
    """
    kept = recalled(kind, key, read)
    if kept is not None:
        return kept
    folder = folder_of(kind)
    path = folder / f"{key}.h5"
    result = find()
    if folder.is_absolute():  # else the user has no home
        with suppress(UserError, OSError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if not is_own(folder.lstat(), stat.S_ISDIR):
                return result
            folder.chmod(0o700)
            write(path, result)
            path.chmod(0o600)  # whatever the user lets others do with other files
            _make_room(folder)
    return result


def recalled(kind: str, key: str, read: Callable[[Path], Found]) -> Found | None:
    """What was found before, or None; see `remembered`."""
    folder = folder_of(kind)
    path = folder / f"{key}.h5"
    with suppress(UserError, OSError):
        if _is_private(folder, stat.S_ISDIR) and _is_private(path, stat.S_ISREG):
            kept = read(path)
            os.utime(path)
            return kept
    return None


def folder_of(kind: str) -> Path:
    """Where entries of a kind are kept."""
    from platformdirs import user_cache_path

    named = os.environ.get(PLACE)
    return (Path(named).absolute() if named else user_cache_path("carillon")) / kind


def _is_private(path: Path, is_kind: Callable[[int], bool]) -> bool:
    """Whether a folder or file is this user's, and nobody else can write it."""
    status = path.lstat()
    return is_own(status, is_kind) and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _make_room(folder: Path) -> None:
    """Remove the entries used least recently, until the others take no more than `MOST_BYTES`."""
    entries = [(path, path.stat()) for path in folder.glob("*.h5")]
    size = sum(status.st_size for _, status in entries)
    for path, status in sorted(entries, key=lambda entry: entry[1].st_mtime_ns):
        if size <= MOST_BYTES:
            return
        path.unlink(missing_ok=True)
        size -= status.st_size
