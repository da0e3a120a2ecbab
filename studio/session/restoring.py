"""Sessions as they are kept between two runs, and gone on with: nothing in them leads elsewhere."""

import asyncio
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from carillon.command_line.progress import say
from carillon.errors import UserError
from studio.session.document import Document, History, Material, files_of
from studio.session.workspace import OWN_FOLDER, OutsideError, Workspace

NONSENSE = (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, UserError)
"""Exceptions on reading a session that is none, or one of another version."""
LONGEST_NAME = 255
"""Longest name of a project in characters, as long as that of a file."""
SOON_SECONDS = 0.3
"""Time between a change and its saving; more changes may come together."""


def kept(history: History, workspace: Workspace) -> dict[str, Any]:
    """A history as plain values, designs by their paths from the workspace's folder.

    So the folder may be moved, or given to somebody else.
    """
    return _with_designs(history, lambda design: _from_folder(design, workspace)).as_json()


def restored(values: Mapping[str, Any], workspace: Workspace) -> History:
    """The history that `kept` told.

    Raises OutsideError if any document in it names a file outside of the workspace, and one of
    `NONSENSE` if it is none.
    """
    history = History.from_json(dict(values))
    sound: list[tuple[Any, Any]] = []
    for document in _documents(history):
        # Most steps have the settings and targets of the one before.
        if (document.settings, document.targets) not in sound[-1:]:
            for file in files_of(document):
                workspace.path(file)
            if document.mesh is not None or document.settings or document.targets:
                document.require_sound(workspace.folder)
            sound.append((document.settings, document.targets))
        if document.heard not in (None, "A", "B"):
            raise ValueError(f"a material is heard as {document.heard!r}")
        for material in _materials(document):
            _require_finite(material)
    return _with_designs(history, lambda design: str(_found(design, workspace)))


def _documents(history: History) -> Iterator[Document]:
    yield history.document
    yield from (document for _, document in (*history.before, *history.after))


def _materials(document: Document) -> list[Material]:
    return [each for each in (document.material, document.kept) if each is not None]


def _require_finite(material: Material) -> None:
    if not all(map(math.isfinite, material.z)):
        raise ValueError("a material has coordinates that are not finite")
    if material.design is not None and not isinstance(material.design, str):
        raise TypeError(f"a design is named {material.design!r}")


def _with_designs(history: History, named: Callable[[str], str]) -> History:
    """The history, each design of it by another name."""

    def changed(document: Document) -> Document:
        return replace(document, material=renamed(document.material), kept=renamed(document.kept))

    def renamed(material: Material | None) -> Material | None:
        if material is None or material.design is None:
            return material
        return replace(material, design=named(material.design))

    return History(
        changed(history.document),
        [(name, changed(document)) for name, document in history.before],
        [(name, changed(document)) for name, document in history.after],
    )


def _from_folder(design: str, workspace: Workspace) -> str:
    path = Path(design)
    inside = path.is_relative_to(workspace.folder)
    return str(path.relative_to(workspace.folder)) if inside else design


def _found(design: str, workspace: Workspace) -> Path:
    """Where a design is that a session names, if only by where it was before the folder was moved.

    Raises OutsideError if it is outside of the workspace, and there is none of its name inside.
    """
    own = Path(OWN_FOLDER, "designs", Path(design).name)
    names = [design, str(own) if Path(design).parts[-3:] == own.parts else Path(design).name]
    for name in names:
        try:
            path = workspace.path(name)
        except OutsideError:
            continue
        if path.is_file() or name == design:
            return path
    raise OutsideError(f"the design {design} lies outside of the workspace {workspace.folder.name}")


class Autosave:
    """Writes what `session` returns by `write`, in the background."""

    def __init__(
        self, session: Callable[[], dict[str, Any]], write: Callable[[dict[str, Any]], None]
    ) -> None:
        self._session, self._write = session, write
        self._due = asyncio.Event()
        self._seconds = SOON_SECONDS

    def soon(self, seconds: float = SOON_SECONDS) -> None:
        """Save within some seconds."""
        self._seconds = min(seconds, self._seconds) if self._due.is_set() else seconds
        self._due.set()

    def save(self) -> None:
        """Save now; what cannot be written is told in the terminal."""
        self._due.clear()
        try:
            self._write(self._session())
        except UserError as error:
            say(str(error))

    async def run(self) -> None:
        """Save whenever it is due."""
        while True:
            await self._due.wait()
            await asyncio.sleep(self._seconds)
            self.save()
