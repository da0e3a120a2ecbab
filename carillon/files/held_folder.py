"""A folder that is held open: what is read and written in it lies in it, and no link leads away."""

from __future__ import annotations

import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import IO

from carillon.errors import UserError
from carillon.files import system
from carillon.files.atomic import remove_leftovers, temporary_name
from carillon.files.open_folder import OpenFolder
from carillon.files.paths import cause, kind_of_mode, require_plain

_MISSING = 0


class HeldFolder:
    """A folder that is held open, so that nobody puts another one in its place.

    Names are those of things directly in it. Links in it are never followed: a file that is one is
    neither read nor replaced. What is replaced is another file of that name, never written to in
    place, so that a second name of the old one (a hard link) keeps its content. Raises OSError if
    there is no such folder, or it cannot be opened.

    Parameters
    ----------
    path
        Of the folder, for messages too; it may be a link or lead through links.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._folder = OpenFolder(path)

    def close(self) -> None:
        """Let go of the folder."""
        self._folder.close()

    def child(self, name: str) -> HeldFolder:
        """The folder `name` in this one, made if there is none.

        Raises UserError if something else has that name, a link above all, and OSError if it can be
        neither made nor opened.
        """
        with suppress(FileExistsError):
            self._folder.make(_plain(name))
        mode = self._mode(name)
        if not stat.S_ISDIR(mode):
            raise UserError(
                f"{self.path / name}: is a {kind_of_mode(mode)}, expected a folder; remove it"
            )
        folder = HeldFolder.__new__(HeldFolder)
        folder.path = self.path / name
        folder._folder = OpenFolder(name, within=self._folder)
        return folder

    def names(self) -> list[str]:
        """Names of all that is in it."""
        return self._folder.names()

    def has(self, name: str) -> bool:
        """Whether anything has this name, a link to nothing included."""
        return self._mode(name) != _MISSING

    def has_file(self, name: str) -> bool:
        """Whether a regular file has this name."""
        return stat.S_ISREG(self._mode(name))

    def require_replaceable(self, name: str) -> None:
        """Check that a file of this name may be written: there is none, or a regular one.

        Raises UserError if a link, folder, pipe, device or socket has the name.
        """
        mode = self._mode(name)
        if mode != _MISSING and not stat.S_ISREG(mode):
            raise UserError(
                f"{self.path / name}: is a {kind_of_mode(mode)}, expected a file, or nothing; "
                "remove it, or name another"
            )

    @contextmanager
    def reading(self, name: str) -> Iterator[IO[bytes]]:
        """Open a regular file for reading.

        Raises UserError if it is missing, something else, or cannot be read.
        """
        self._require_file(name)
        try:
            with os.fdopen(self._folder.open(name, os.O_RDONLY), "rb") as stream:
                yield stream
        except OSError as error:
            raise UserError(f"{self.path / name}: cannot be read ({cause(error)})") from None

    def read(self, name: str, most: int) -> bytes:
        """Content of a file.

        `most`: bytes that it may have. Raises UserError as `reading` does, or if it is longer.
        """
        with self.reading(name) as stream:
            content = stream.read(most + 1)
        if len(content) > most:
            raise UserError(f"{self.path / name}: is longer than {most:,} bytes")
        return content

    @contextmanager
    def writing(self, name: str) -> Iterator[IO[bytes]]:
        """Write a file: under another name first, flushed to disk, then renamed.

        When the body raises, the temporary file is removed and what was there stays. Raises
        UserError if the name is none for a file, something else than a regular file has it, or the
        file cannot be written.
        """
        require_plain(self.path / _plain(name))
        self.require_replaceable(name)
        try:
            remove_leftovers(self._folder, name)
            with ExitStack() as ending:
                temporary, stream = self._new_temporary(name)
                ending.callback(self.remove, temporary)
                ending.callback(_close, stream)
                yield stream
                stream.flush()
                os.fsync(stream.fileno())
                self.require_replaceable(name)  # what may have come there in the meantime
                if not system.RENAMES_OPEN:
                    stream.close()
                self._folder.rename(temporary, name)
                with suppress(OSError):
                    self._folder.sync()
        except OSError as error:
            raise UserError(f"{self.path / name}: could not be written ({cause(error)})") from error

    def write(self, name: str, content: bytes) -> None:
        """Write a file at once; errors as those of `writing`."""
        with self.writing(name) as stream:
            stream.write(content)

    def remove(self, name: str) -> None:
        """Remove a name, not what a link of that name leads to."""
        with suppress(FileNotFoundError):
            self._folder.remove(_plain(name))

    @contextmanager
    def passing(self, start: str) -> Iterator[Path]:
        """A new folder in this one, with a name that begins with `start`; gone at the end.

        Raises OSError if it cannot be made.
        """
        name = f"{start}{secrets.token_hex(8)}"
        self._folder.make(_plain(name), 0o700)
        try:
            yield self.path / name
        finally:
            self._folder.remove_folder(name)

    def remove_passing(self, start: str) -> None:
        """Remove folders that killed users of `passing` have left."""
        for name in self.names():
            if name.startswith(start) and stat.S_ISDIR(self._mode(name)):
                self._folder.remove_folder(name)

    def _mode(self, name: str) -> int:
        """File mode of the entry of a name, links not followed; `_MISSING` if there is none."""
        try:
            return self._folder.status(_plain(name)).st_mode
        except FileNotFoundError:
            return _MISSING
        except OSError as error:
            raise UserError(f"{self.path / name}: cannot be used ({cause(error)})") from None

    def _require_file(self, name: str) -> None:
        if not self.has(name):
            raise UserError(f"{self.path / name}: no such file")
        self.require_replaceable(name)

    def _new_temporary(self, name: str) -> tuple[str, IO[bytes]]:
        """A new file and its name; it is locked as long as its writer lives."""
        start, end = temporary_name(name)
        while True:
            temporary = f"{start}{secrets.token_hex(4)}{end}"
            with suppress(FileExistsError):
                file = self._folder.open(temporary, os.O_RDWR | os.O_CREAT | os.O_EXCL)
                with suppress(OSError):  # a file system without locks, where leftovers stay
                    system.lock(file, shared=True)
                if self.has(temporary):
                    return temporary, os.fdopen(file, "wb")
                os.close(file)  # another writer took it for a leftover, before it was locked


def _plain(name: str) -> str:
    """A name that leads nowhere else.

    Raises UserError if it does.
    """
    if not name or name in (".", "..") or set(name) & {"/", os.sep, "\0"}:
        raise UserError(f"{name!r}: is no name of a file, expected one without slashes")
    return name


def _close(stream: IO[bytes]) -> None:
    """Close a file whose content no longer matters, or is on disk already."""
    with suppress(OSError):
        stream.close()
