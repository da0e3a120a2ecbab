"""Files that are complete or absent: written aside, flushed to disk, then renamed.

What killed writers leave under temporary names is removed by the next one.
"""

import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path, PurePath
from typing import IO

from carillon.errors import UserError
from carillon.files import system
from carillon.files.open_folder import OpenFolder
from carillon.files.paths import cause, require_writable, target_of

LONGEST_ENDING = 10
"""Longest ending of a file's name in characters that a temporary name keeps."""


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
        holder, temporary = _new_temporary(target)
        try:
            with holder:
                yield temporary
                umask = os.umask(0)
                os.umask(umask)
                os.chmod(temporary, 0o666 & ~umask)
                with open(temporary, "rb+") as stream:
                    os.fsync(stream.fileno())
                target_of(path)  # refuses what may have come there in the meantime
                if not system.RENAMES_OPEN:
                    holder.close()
                os.replace(temporary, target)
                sync_folder(target.parent)
        finally:
            temporary.unlink(missing_ok=True)
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
    folder = OpenFolder(target.parent)
    try:
        remove_leftovers(folder, target.name)
    finally:
        folder.close()


def _new_temporary(path: Path) -> tuple[IO[bytes], Path]:
    """A new file beside `path`, open as long as its writer lives, which locks it, and its name.

    The lock is shared, as HDF5 readers may find the file under its final name before it ends.
    """
    start, end = temporary_name(path.name)
    while True:
        handle, name = tempfile.mkstemp(prefix=start, suffix=end, dir=path.parent)
        with suppress(OSError):  # a file system without locks, where leftovers stay
            system.lock(handle, shared=True)
        if os.path.exists(name):
            return os.fdopen(handle, "rb"), Path(name)
        os.close(handle)  # another writer took it for a leftover, before it was locked


def temporary_name(name: str) -> tuple[str, str]:
    """Beginning and end of the temporary names of a file called `name`.

    Examples
    --------
    >>> temporary_name("pan.yaml")
    ('.pan.yaml.', '.partial.yaml')
    """
    suffix = PurePath(name).suffix
    return f".{name}.", f".partial{suffix if len(suffix) <= LONGEST_ENDING else ''}"


def remove_leftovers(folder: OpenFolder, name: str) -> None:
    """Remove temporary files of `name` that nobody holds a lock on.

    Regular files alone are opened: links, pipes and devices of such names are somebody else's.
    """
    start, end = temporary_name(name)
    for other in folder.names():
        if other.startswith(start) and other.endswith(end):
            with suppress(OSError):
                _remove_unlocked(folder, other)


def _remove_unlocked(folder: OpenFolder, name: str) -> None:
    if not stat.S_ISREG(folder.status(name).st_mode):
        return
    if not system.RENAMES_OPEN:
        folder.remove(name)
        return
    file = folder.open(name, os.O_RDWR)
    try:
        system.lock(file)
        folder.remove(name)
    finally:
        os.close(file)
