"""Temporary names of files under way, and what killed writers leave under such names."""

from __future__ import annotations

import fcntl
import os
import stat
from contextlib import suppress
from pathlib import PurePath

LONGEST_ENDING = 10
"""Longest ending of a file's name in characters that a temporary name keeps."""


def temporary_name(name: str) -> tuple[str, str]:
    """Beginning and end of the temporary names of a file called `name`.

    Examples
    --------
    >>> temporary_name("pan.yaml")
    ('.pan.yaml.', '.partial.yaml')
    """
    suffix = PurePath(name).suffix
    return f".{name}.", f".partial{suffix if len(suffix) <= LONGEST_ENDING else ''}"


def remove_leftovers(folder: int, name: str) -> None:
    """Remove temporary files of `name` that nobody holds a lock on.

    Regular files alone are opened: links, pipes and devices of such names are somebody else's.

    Parameters
    ----------
    folder
        Descriptor of the folder that they are in.
    """
    start, end = temporary_name(name)
    for other in os.listdir(folder):
        if other.startswith(start) and other.endswith(end):
            with suppress(OSError):
                _remove_unlocked(folder, other)


def _remove_unlocked(folder: int, name: str) -> None:
    if not stat.S_ISREG(os.stat(name, dir_fd=folder, follow_symlinks=False).st_mode):
        return
    flags = os.O_RDWR | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    file = os.open(name, flags, dir_fd=folder)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.unlink(name, dir_fd=folder)
    finally:
        os.close(file)
