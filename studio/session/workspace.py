"""The folder that a studio works in: meshes, clips, projects, and what it keeps for itself."""

import json
import re
import shutil
from collections.abc import Mapping
from contextlib import AbstractContextManager, ExitStack, suppress
from itertools import count
from pathlib import Path
from typing import Any

from carillon.command_line.counts import counted
from carillon.errors import UserError, one_line
from carillon.files.held_folder import HeldFolder
from carillon.files.locks import remove_and_close, take
from carillon.files.paths import cause, require_plain
from carillon.files.yaml_input import MOST_BYTES, parse_yaml, read_yaml
from sound.heads.head_space import head_files
from sound.project.template import project_text

OWN_FOLDER = ".studio"
"""Folder of the session and of designs that undo may go back to."""
PROJECT_ENDINGS = (".yaml", ".yml")
MOST_PROJECTS = 200
"""Most projects that are listed."""
MOST_FOLDERS = 200
"""Most folders of heads that are listed."""
LONGEST_NAME = 64
SESSION = "session.json"
MOST_SESSION_BYTES = 1 << 28
"""Longest session in bytes that is read; thousands of unknowns and all steps take less."""
_DESIGNS, _LOCK, _EXPORT = "designs", "lock", "export-"
_NAME = re.compile(r"[A-Za-z0-9_-]+")
_NUMBERED = re.compile(r"[0-9]{1,20}\.h5")
"""Designs that the studio itself has named."""


class OutsideError(UserError):
    """A file that is named and lies outside of the workspace."""


class Workspace:
    """Files of a workspace, which nothing leads out of.

    The folder itself may be a link, or be reached through links, as its user has named it.  What
    the studio writes or removes in it may not, since folders come from others, too.

    Raises
    ------
    UserError
        If the folder cannot be written, another studio works in it, or what the studio keeps there
        for itself is no folder or file, but a link for instance.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()
        require_plain(self.folder)
        with ExitStack() as ending:
            try:
                self.folder.mkdir(parents=True, exist_ok=True)
                self._files = HeldFolder(self.folder)
                ending.callback(self._files.close)
                self._own = self._files.child(OWN_FOLDER)
                ending.callback(self._own.close)
                self._designs = self._own.child(_DESIGNS)
                ending.callback(self._designs.close)
            except OSError as error:
                raise UserError(
                    f"{folder}: cannot be written ({cause(error)}), expected a folder for the "
                    "studio's files; name another by --workspace"
                ) from None
            for name in (SESSION, _LOCK):
                self._own.require_replaceable(name)
            self._lock = take(
                self._own.path / _LOCK,
                f"{folder}: another studio works in this folder; use that one",
            )
            self._ending = ending.pop_all()
        self._own.remove_passing(_EXPORT)

    def close(self) -> None:
        """Let another studio have the folder."""
        remove_and_close(self._own.path / _LOCK, self._lock)
        self._ending.close()

    def path(self, name: str) -> Path:
        """Where a file is that a project names.

        Raises OutsideError if that is outside of the folder, by whatever way, and UserError if
        there can be no such file.
        """
        try:
            path = (self.folder / name).resolve()
        except (OSError, ValueError, RuntimeError) as error:  # a null byte, a link to itself
            raise UserError(
                f"{name:.200}: is no name of a file ({one_line(str(error))}), expected one in the "
                "workspace; name another"
            ) from None
        if not path.is_relative_to(self.folder):
            raise OutsideError(
                f"{name}: lies outside of the workspace {self.folder.name}, expected a file in it; "
                "copy it there, and name the copy"
            )
        return path

    def put(self, name: str, content: bytes) -> str:
        """Write an uploaded file under its name, or another one if something else has that."""
        stem, suffix = Path(name).stem, Path(name).suffix
        for number in range(1, 10_000):
            free = name if number == 1 else f"{stem}-{number}{suffix}"
            if self._files.has_file(free) and self._holds(free, content):
                return free
            if not self._files.has(free):
                self._files.write(free, content)
                return free
        raise UserError(f"{name}: there are too many files of this name; give it another")

    def _holds(self, name: str, content: bytes) -> bool:
        with self._files.reading(name) as stream:
            return stream.read(len(content) + 1) == content

    def projects(self) -> list[str]:
        """Names of the projects, without ending."""
        paths = [path for path in self.folder.iterdir() if path.suffix in PROJECT_ENDINGS]
        return sorted(path.stem for path in paths if path.is_file())[:MOST_PROJECTS]

    def read_project(self, name: str) -> dict[str, Any]:
        """Keys and values of a project's file.

        Raises UserError if there is no such file, or it is no project.
        """
        for ending in PROJECT_ENDINGS:
            path = self.path(f"{name}{ending}")
            if path.is_file():
                return read_yaml(path, "a project")
        raise UserError(f"{name}: there is no such project in the workspace")

    def require_savable(self, name: str) -> None:
        """Check that all files of a project may be written.

        Raises UserError if the name is none for a project, or one of its files is a link or
        something else that the studio does not write to.
        """
        require_name(name)
        for file in (f"{name}.yaml", f"{name}.yaml~", f"{name}.h5"):
            self._files.require_replaceable(file)

    def write_project(self, name: str, described: Mapping[str, Any]) -> None:
        """Write a project's file; one that was edited by hand stays beside it, as NAME.yaml~.

        Raises UserError as `require_savable` does, or if a file cannot be written.
        """
        self.require_savable(name)
        file = f"{name}.yaml"
        if self._files.has_file(file) and self._is_edited(file):
            self._copy(file, f"{file}~")
        self._files.write(file, project_text(described).encode())

    def write_design(self, name: str, design: Path) -> None:
        """Write a project's design, a copy of another file.

        Raises UserError as `require_savable` does, or if a file cannot be read or written.
        """
        self.require_savable(name)
        self.write_copy(f"{name}.h5", design)

    def write(self, file: str, content: bytes) -> None:
        """Write a file of the folder; raises UserError if it is a link or cannot be written."""
        self._files.write(file, content)

    def write_copy(self, file: str, path: Path) -> None:
        """Write a file of the folder, a copy of another one; errors as those of `write`."""
        try:
            with open(path, "rb") as source, self._files.writing(file) as copy:
                shutil.copyfileobj(source, copy)
        except OSError as error:
            raise UserError(f"{path}: cannot be read ({cause(error)})") from None

    def set_aside(self, file: str) -> None:
        """Rename a file of the folder, if there is one, to FILE~; errors as those of `write`."""
        self._files.require_replaceable(file)
        if self._files.has_file(file):
            self._copy(file, f"{file}~")
            self._files.remove(file)

    def head_folders(self) -> dict[str, int]:
        """Numbers of measured heads in the folders of this one, links aside, that have some."""
        found: dict[str, int] = {}
        for path in sorted(self.folder.iterdir()):
            if len(found) == MOST_FOLDERS:
                break
            if path.name.startswith(".") or path.is_symlink() or not path.is_dir():
                continue
            with suppress(OSError):  # a folder that may not be read
                if count := len(head_files(path)):
                    found[path.name] = count
        return found

    def heads(self, folder: str, most: int, most_bytes: int) -> Path:
        """A folder of measured heads by a name that `head_folders` lists.

        Raises OutsideError if a head in it lies outside of the workspace, and UserError if there
        are fewer than two of them, or more or larger ones than that.
        """
        files = [self.path(f"{folder}/{path.name}") for path in head_files(self.folder / folder)]
        if len(files) < 2:
            raise UserError(
                f"{folder}: has {counted(len(files), 'measured head')}, expected at least two to "
                "blend; copy more SOFA files there, from a database that sofaconventions.org lists"
            )
        size = sum(file.stat().st_size for file in files if file.is_file())
        if len(files) > most or size > most_bytes:
            raise UserError(
                f"{folder}: has {len(files):,} measured heads of {size:,} bytes, expected at most "
                f"{most:,} of {most_bytes:,}; copy fewer into another folder"
            )
        return self.path(folder)

    def _copy(self, name: str, other: str) -> None:
        with self._files.reading(name) as source, self._files.writing(other) as copy:
            shutil.copyfileobj(source, copy)

    def _is_edited(self, name: str) -> bool:
        """Whether a project's file has anything in it that writing it again would lose."""
        try:
            text = self._files.read(name, MOST_BYTES).decode()
            return text != project_text(parse_yaml(text))
        except (UserError, UnicodeDecodeError, LookupError, TypeError, AttributeError):
            return True

    def new_design(self) -> Path:
        """A name for a design that undo may go back to, which nothing has yet."""
        taken = set(self._designs.names())
        numbers = [int(Path(name).stem) for name in taken if _NUMBERED.fullmatch(name)]
        free = (f"{number}.h5" for number in count(max(numbers, default=0) + 1))
        return self._designs.path / next(name for name in free if name not in taken)

    def forget_designs(self, kept: set[str]) -> None:
        """Remove all such designs but those that are `kept`."""
        for name in self._designs.names():
            is_own = _NUMBERED.fullmatch(name) and self._designs.has_file(name)
            if is_own and str(self._designs.path / name) not in kept:
                self._designs.remove(name)

    def exporting(self) -> AbstractContextManager[Path]:
        """A new folder for a file that is soon removed, and it with it."""
        return self._own.passing(_EXPORT)

    def write_session(self, session: Mapping[str, Any]) -> None:
        """Write what the studio goes on with when it is started again."""
        self._own.write(SESSION, json.dumps(session).encode())

    def read_session(self) -> dict[str, Any] | None:
        """What `write_session` wrote last; None if there is nothing that can be used."""
        try:
            session = json.loads(self._own.read(SESSION, MOST_SESSION_BYTES))
        except (UserError, ValueError, RecursionError):
            return None
        return session if isinstance(session, dict) else None


def require_name(name: str) -> str:
    """A project's name that is fit for a file; raises UserError if it is not."""
    if not _NAME.fullmatch(name) or len(name) > LONGEST_NAME:
        raise UserError(
            f"the name {name!r}: expected letters, digits, - and _, {LONGEST_NAME} at most"
        )
    return name
