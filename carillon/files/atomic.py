"""Files that are complete or absent: written aside, flushed to disk, then renamed."""

from __future__ import annotations

import fcntl
import os
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from carillon.errors import UserError
from carillon.files.leftovers import remove_leftovers, temporary_name
from carillon.files.paths import cause, require_writable, target_of


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Yield a temporary name beside `path`; on success fsync it and rename it to `path`.

    Only regular files are replaced, see `require_writable`.  When the body raises, the temporary
    file is removed and `path` stays as it was.  What killed writers of `path` have left is removed
    too.  Of several writers at a time the last one stays; readers see one whole file or another.
    """
    path = require_writable(path)
    try:
        target = target_of(path)
        _clear(target)
        handle, temporary = _new_temporary(target)
        try:
            yield temporary
            umask = os.umask(0)
            os.umask(umask)
            os.chmod(temporary, 0o666 & ~umask)
            with open(temporary, "rb+") as stream:
                os.fsync(stream.fileno())
            target_of(path)  # refuses what may have come there in the meantime
            os.replace(temporary, target)
            sync_folder(target.parent)
        finally:
            temporary.unlink(missing_ok=True)
            os.close(handle)
    except OSError as error:
        raise UserError(f"{path}: could not be written ({cause(error)})") from error


def sync_folder(folder: Path) -> None:
    """Bring names made, changed or removed in `folder` to disk, where that is possible."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _clear(target: Path) -> None:
    """Remove what killed writers of `target` have left."""
    folder = os.open(target.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        remove_leftovers(folder, target.name)
    finally:
        os.close(folder)


def _new_temporary(path: Path) -> tuple[int, Path]:
    """A new file beside `path` and its handle, which holds a lock as long as its writer lives.

    The lock is shared, as HDF5 readers may find the file under its final name before it ends.
    """
    start, end = temporary_name(path.name)
    while True:
        handle, name = tempfile.mkstemp(prefix=start, suffix=end, dir=path.parent)
        with suppress(OSError):  # a file system without locks, where leftovers stay
            fcntl.flock(handle, fcntl.LOCK_SH)
        if os.path.exists(name):
            return handle, Path(name)
        os.close(handle)  # another writer took it for a leftover, before it was locked


def by_stem(paths: Iterable[str | Path]) -> dict[str, str]:
    """Names of files by their stems, or by themselves where stems are equal.

    Examples
    --------
    >>> by_stem(["a/bell.h5", "a/pan.h5"])
    {'bell': 'a/bell.h5', 'pan': 'a/pan.h5'}
    >>> by_stem(["a/bell.h5", "b/bell.h5"])
    {'a/bell.h5': 'a/bell.h5', 'b/bell.h5': 'b/bell.h5'}
    """
    names = list(dict.fromkeys(map(str, paths)))
    stems = [Path(name).stem for name in names]
    return dict(zip(stems if len(set(stems)) == len(stems) else names, names, strict=True))
