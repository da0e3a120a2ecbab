"""The folder that a studio works in: meshes, clips, projects, and what it keeps for itself."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from carillon.documents import read_yaml
from carillon.errors import UserError
from carillon.files import atomic_path
from carillon.locks import take
from sound.project.template import project_text

OWN_FOLDER = ".studio"
"""For the session, and designs that undo may go back to."""
PROJECT_ENDINGS = (".yaml", ".yml")
MOST_PROJECTS = 200
"""That are listed."""
LONGEST_NAME = 64
_NAME = re.compile(r"[A-Za-z0-9_-]+")


class Workspace:
    """Files of a workspace, which nothing leads out of.

    Raises
    ------
    UserError
        If the folder cannot be written, or another studio works in it.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()
        try:
            self._own = self.folder / OWN_FOLDER
            (self._own / "designs").mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise UserError(
                f"{folder}: cannot be written ({error.strerror}), expected a folder for the "
                "studio's files; name another by --workspace"
            ) from None
        self._lock = take(
            self._own / "lock", f"{folder}: another studio works in this folder; use that one"
        )

    def close(self) -> None:
        """Let another studio have the folder."""
        (self._own / "lock").unlink(missing_ok=True)
        os.close(self._lock)

    def path(self, name: str) -> Path:
        """Where a file is that a project names.

        Raises
        ------
        UserError
            If that is outside of the folder, by whatever way.
        """
        path = (self.folder / name).resolve()
        if not path.is_relative_to(self.folder):
            raise UserError(
                f"{name}: lies outside of the workspace {self.folder.name}, expected a file in it; "
                "copy it there"
            )
        return path

    def put(self, name: str, content: bytes) -> str:
        """Write an uploaded file under its name, or another one if that has another content."""
        stem, suffix = Path(name).stem, Path(name).suffix
        for number in range(1, 10_000):
            free = name if number == 1 else f"{stem}-{number}{suffix}"
            path = self.path(free)
            if path.is_file() and path.read_bytes() == content:
                return free
            if not path.exists():
                with atomic_path(path) as temporary:
                    temporary.write_bytes(content)
                return free
        raise UserError(f"{name}: there are too many files of this name; give it another")

    def projects(self) -> list[str]:
        """Names of the projects, without ending."""
        found = [path for path in self.folder.iterdir() if path.suffix in PROJECT_ENDINGS]
        return sorted(path.stem for path in found if path.is_file())[:MOST_PROJECTS]

    def read_project(self, name: str) -> dict[str, Any]:
        """Keys and values of a project's file.

        Raises
        ------
        UserError
            If there is no such file, or it is no project.
        """
        for ending in PROJECT_ENDINGS:
            path = self.path(f"{name}{ending}")
            if path.is_file():
                return read_yaml(path, "a project")
        raise UserError(f"{name}: there is no such project in the workspace")

    def write_project(self, name: str, described: Mapping[str, Any]) -> None:
        """Write a project's file; one that was edited by hand stays beside it, as NAME.yaml~."""
        path = self.path(f"{require_name(name)}.yaml")
        if path.is_file() and _is_edited(path):
            with atomic_path(path.with_name(f"{path.name}~")) as temporary:
                temporary.write_bytes(path.read_bytes())
        with atomic_path(path) as temporary:
            temporary.write_text(project_text(described), encoding="utf-8")

    def design(self, name: str) -> Path:
        """The design that goes with a project."""
        return self.path(f"{name}.h5")

    def new_design(self) -> Path:
        """A name for a design that undo may go back to."""
        folder = self._own / "designs"
        taken = [int(path.stem) for path in folder.glob("*.h5") if path.stem.isdigit()]
        return folder / f"{max(taken, default=0) + 1}.h5"

    def forget_designs(self, kept: set[str]) -> None:
        """Remove all such designs but those that are `kept`."""
        for path in (self._own / "designs").glob("*.h5"):
            if str(path) not in kept:
                path.unlink(missing_ok=True)

    def temporary(self, name: str) -> Path:
        """A place for a file that is soon removed."""
        return self._own / name

    def write_session(self, session: Mapping[str, Any]) -> None:
        """Write what the studio goes on with when it is started again."""
        with atomic_path(self._own / "session.json") as temporary:
            temporary.write_text(json.dumps(session), encoding="utf-8")

    def read_session(self) -> dict[str, Any] | None:
        """What `write_session` wrote last; None if there is nothing that can be used."""
        try:
            session = json.loads((self._own / "session.json").read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return session if isinstance(session, dict) else None


def _is_edited(path: Path) -> bool:
    """Whether a project's file has anything in it that writing it again would lose."""
    try:
        values = read_yaml(path, "a project")
        return path.read_text(encoding="utf-8") != project_text(values)
    except (UserError, UnicodeDecodeError, LookupError, TypeError, AttributeError):
        return True


def require_name(name: str) -> str:
    """A project's name that is fit for a file.

    Raises
    ------
    UserError
        If it is not.
    """
    if not _NAME.fullmatch(name) or len(name) > LONGEST_NAME:
        raise UserError(
            f"the name {name!r}: expected letters, digits, - and _, {LONGEST_NAME} at most"
        )
    return name
