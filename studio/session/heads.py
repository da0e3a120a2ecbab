"""Measured heads of the workspace, kept in their process, and the search for the preferred one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from carillon.errors import UserError
from studio.binary import unpack
from studio.interface import NotFoundError
from studio.processes.heads import StruckModes
from studio.processes.worker import Worker
from studio.session.workspace import Workspace

READ_SECONDS = 1800.0
"""Longest time to read the heads of a folder, about 2 s each, and the answers of a calibration."""
ANSWER_SECONDS = 60.0
"""Longest time to take an answer, to make a sound or to write a blend."""
MOST_HEADS, MOST_BYTES = 200, 1 << 31
"""Most measured heads of a folder, and bytes of them all."""
_NOTHING: dict[str, Any] = {"heads": None, "comparisons": None, "direction": None}
"""News while no heads were read."""


class Heads:
    """The folder of heads that is used, if any, and how far its calibration is.

    `folder` is its name in the workspace; its `phase` is `none`, `reading`, `ready` or `failed`,
    `message` tells what is done or why it failed.  `changed` is called when pages are to know more.
    """

    def __init__(self, workspace: Workspace, changed: Callable[[], None]) -> None:
        self._workspace, self._changed = workspace, changed
        self._worker = Worker("studio.processes.heads:HeadsProcess")
        self._folders: dict[str, int] = {}
        self._attempts = 0
        self.folder: str | None = None
        self.phase = "none"
        self.message: str | None = None
        self._progress: float | None = None
        self._news = _NOTHING
        self._blend: dict[str, Any] | None = None

    def end(self) -> None:
        """End the process."""
        self._worker.end()

    def look(self) -> None:
        """See which folders of heads there are."""
        self._folders = self._workspace.head_folders()
        self._changed()

    async def open(self, folder: str, anew: bool = False) -> None:
        """Read the heads of a folder; go on with its calibration, or begin one `anew`.

        What is wrong with heads or calibration is told as `message`.  Raises NotFoundError if the
        workspace has no such folder.
        """
        self._folders = self._workspace.head_folders()
        if folder not in self._folders:
            raise NotFoundError(
                f"{folder:.100}: is no folder of the workspace that has measured heads (*.sofa); "
                "copy some into one"
            )
        self._attempts += 1
        attempt = self._attempts
        self._worker.end()
        self.folder, self._news, self._blend = folder, _NOTHING, None
        self._become("reading")

        def tell(news: tuple[str, float]) -> None:
            if self._attempts == attempt:
                self.message, self._progress = news
                self._changed()

        try:
            path = self._workspace.heads(folder, MOST_HEADS, MOST_BYTES)
            if anew:
                self._workspace.set_aside(self.file)
            saved = self._workspace.path(self.file)
            given = str(saved) if saved.exists() else None
            news = await self._worker.call(
                "read", str(path), given, seconds=READ_SECONDS, tell=tell
            )
        except UserError as error:
            if self._attempts == attempt:
                self._worker.end()
                self._become("failed", str(error))
            return
        if self._attempts == attempt:
            self._news = news
            self._become("ready")

    @property
    def file(self) -> str:
        """Name of the file in the workspace that has the calibration of the folder."""
        return f"{self.folder}-calibration.json"

    async def answer(self, number: int, score: int) -> None:
        """Take the score of a comparison, and save it.

        Raises UserError if it is not the present one, or the file cannot be written.
        """
        self._require_ready()
        self._news, text = await self._ask("answer", number, score)
        self._changed()
        self._workspace.write(self.file, text.encode())

    async def sound(self, number: int, part: str, strike: StruckModes | None) -> bytes:
        """A sound of a comparison as WAV, see `studio.processes.heads.HeadsProcess.sound`."""
        self._require_ready()
        content: bytes = await self._ask("sound", number, part, strike)
        return content

    async def write_blend(self) -> None:
        """Write the blend that is preferred at present into the workspace (SOFA)."""
        self._require_ready()
        file = f"{self.folder}-blend.sofa"
        with self._workspace.exporting() as folder:
            out = folder / "blend.sofa"
            comparisons = await self._ask("write", str(out))
            self._workspace.write_copy(file, out)
        self._blend = {"file": file, "comparisons": comparisons}
        self._changed()

    def state(self) -> dict[str, Any]:
        """All of it, as pages get it."""
        return {
            "folders": [{"name": name, "heads": n} for name, n in self._folders.items()],
            "folder": self.folder,
            "phase": self.phase,
            "message": self.message,
            "progress": self._progress,
            **self._news,
            "file": None if self.folder is None else self.file,
            "blend": self._blend,
        }

    def _become(self, phase: str, message: str | None = None) -> None:
        self.phase, self.message, self._progress = phase, message, None
        self._changed()

    def _require_ready(self) -> None:
        if self.phase != "ready":
            raise UserError("no heads were read yet; choose a folder of them first")

    async def _ask(self, name: str, *arguments: Any) -> Any:
        """Call the process; once it has ended, its heads have to be read again."""
        try:
            return await self._worker.call(name, *arguments, seconds=ANSWER_SECONDS)
        except UserError as error:
            if self._worker.pid is None and self.phase == "ready":
                self._become("failed", str(error))
            raise


def strike_of(bank: bytes | None) -> StruckModes:
    """The strike at the first target of a bank, or at its loudest vertex if it has none.

    Raises UserError if there is no bank.
    """
    if bank is None:
        raise UserError("no solid sounds yet; listen to noise, or open a solid")
    _, arrays = unpack(bank)
    struck, gains = arrays["struck"], arrays["gains"]
    loudest = int(np.argmax((gains**2).sum(axis=1)))
    amplitudes = struck[0] if len(struck) else gains[loudest]
    modes = (arrays["hertz"], arrays["dampings"], amplitudes)
    return StruckModes(*(np.array(each, dtype=float) for each in modes))
