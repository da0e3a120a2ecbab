"""A folder that is held open, so that its names are looked up in it whatever takes its place.

Windows has none; there names are looked up by the folder's path each time.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

from carillon.files import system

CAN_BE_HELD = os.open in os.supports_dir_fd and hasattr(os, "O_DIRECTORY")
"""Whether the system holds folders open."""


class OpenFolder:
    """A folder and the operations of `os` on names in it; links are not followed.

    Errors are OSError's.

    Parameters
    ----------
    path
        Of the folder.
    within
        Folder that the path is a name in, if it is one.
    """

    def __init__(self, path: str | Path, within: OpenFolder | None = None) -> None:
        self.path: Path = Path(path) if within is None else within.path / path
        self._number: int | None = None
        if not CAN_BE_HELD:
            if not self.path.is_dir():
                raise NotADirectoryError(f"{self.path}: is no folder")
        elif within is None:
            self._number = os.open(path, os.O_RDONLY | os.O_DIRECTORY | system.BINARY)
        else:
            self._number = within.open(str(path), os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)

    def close(self) -> None:
        """Let go of the folder."""
        if self._number is not None:
            os.close(self._number)

    def names(self) -> list[str]:
        """Names of all that is in it."""
        return os.listdir(self.path if self._number is None else self._number)

    def open(self, name: str, flags: int) -> int:
        """Open a file, or make one that all may read and write whom the umask allows."""
        where, held = self._find(name)
        return os.open(where, flags | system.REGULAR, 0o666, **held)

    def status(self, name: str) -> os.stat_result:
        """Kind, size and times of a name."""
        where, held = self._find(name)
        return os.stat(where, follow_symlinks=False, **held)

    def make(self, name: str, mode: int = 0o777) -> None:
        """Make a folder in it."""
        where, held = self._find(name)
        os.mkdir(where, mode, **held)

    def remove(self, name: str) -> None:
        """Remove a name of a file."""
        where, held = self._find(name)
        os.unlink(where, **held)

    def remove_folder(self, name: str) -> None:
        """Remove a folder in it with all that it has, as far as that can be."""
        where, held = self._find(name)
        shutil.rmtree(where, ignore_errors=True, **held)

    def rename(self, old: str, new: str) -> None:
        """Give a file another name in it, in place of a file that has it."""
        if self._number is None:
            os.replace(self.path / old, self.path / new)
        else:
            os.replace(old, new, src_dir_fd=self._number, dst_dir_fd=self._number)

    def sync(self) -> None:
        """Bring names made, changed or removed in it to disk."""
        if self._number is not None:
            os.fsync(self._number)

    def _find(self, name: str) -> tuple[str | Path, dict[str, Any]]:
        """How `os` is told where a name is."""
        if self._number is None:
            return self.path / name, {}
        return name, {"dir_fd": self._number}
