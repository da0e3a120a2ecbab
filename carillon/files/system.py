"""Flags, locks and reads and writes at a place of files, which Windows has otherwise or lacks.

On Windows a file that is open gets no other name and is not removed: its writer needs no lock
against that, and has to close it first.
"""

import errno
import os
from importlib import import_module
from pathlib import Path
from typing import Any

RENAMES_OPEN = os.name != "nt"
"""Whether a file that is open can be renamed and removed."""
BINARY = getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0) | getattr(os, "O_NOINHERIT", 0)
"""Flag of every file that is opened here: as it is, and not by programs that are started."""
REGULAR = BINARY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
"""Flags for a file that a link, pipe or device may have taken the place of."""

_LOCKED_BYTE = 1 << 30
"""Place of the byte whose lock is a file's on Windows, behind all that is read or written."""
_HELD = (errno.EACCES, errno.EDEADLK)


def optional(module: str) -> Any:
    """A module of Python's own that not every system has, or None."""
    try:
        return import_module(module)
    except ModuleNotFoundError:
        return None


_fcntl, _msvcrt = optional("fcntl"), optional("msvcrt")


def lock(file: int, shared: bool = False, wait: bool = False) -> None:
    """Lock a file until it is closed.

    Raises BlockingIOError if another process holds it and this one does not `wait`, and OSError
    where there are no locks.
    """
    if _fcntl is not None:
        kind = _fcntl.LOCK_SH if shared else _fcntl.LOCK_EX
        _fcntl.flock(file, kind | (0 if shared or wait else _fcntl.LOCK_NB))
    elif _msvcrt is None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))
    elif not shared:
        _lock_byte(file, wait)


def _lock_byte(file: int, wait: bool) -> None:
    here = os.lseek(file, 0, os.SEEK_CUR)
    try:
        os.lseek(file, _LOCKED_BYTE, os.SEEK_SET)
        try:
            _msvcrt.locking(file, _msvcrt.LK_UNLCK, 1)  # what this process holds already
        except OSError:
            pass
        while True:
            try:
                return _msvcrt.locking(file, _msvcrt.LK_LOCK if wait else _msvcrt.LK_NBLCK, 1)
            except OSError as error:
                if error.errno not in _HELD:
                    raise
                if not wait:
                    raise BlockingIOError(error.errno, error.strerror) from None
    finally:
        os.lseek(file, here, os.SEEK_SET)


def read_at(file: int, length: int, position: int) -> bytes:
    """Up to `length` bytes of a file from a position on."""
    if hasattr(os, "pread"):
        return os.pread(file, length, position)
    os.lseek(file, position, os.SEEK_SET)
    return os.read(file, length)


def write_at(file: int, content: bytes | memoryview, position: int) -> int:
    """Write bytes at a position of a file; how many of them were written."""
    if hasattr(os, "pwrite"):
        return os.pwrite(file, content, position)
    os.lseek(file, position, os.SEEK_SET)
    return os.write(file, content)


def may_write(folder: str | Path) -> bool:
    """Whether this user may make files in a folder."""
    effective = os.access in os.supports_effective_ids
    return os.access(folder, os.W_OK | os.X_OK, effective_ids=effective)
