"""Clips of a workspace: who they are, and what was heard in them."""

import asyncio
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from carillon.errors import UserError
from studio.interface import NotFoundError
from studio.processes.clips import ClipFile
from studio.processes.worker import Worker
from studio.session.document import Target

LISTENING_SECONDS = 180.0
"""Longest time to find the modes of a clip."""

STOPPED = "the search for its modes was stopped, so this clip does not count"
_NOTHING: dict[str, Any] = {
    "seconds": None,
    "rate_hz": None,
    "explained": None,
    "says": [],
    "modes": [],
}
"""State of a clip that was not listened to yet."""


@dataclass
class Clip:
    """A clip and what is known of it.

    The page names it by `identifier`; `file` is its path from the workspace's folder.  Its `phase`
    is `waiting`, `listening`, `ready`, `failed` or `stopped`, `message` tells what is done or why
    it failed, `progress` the share of that which is done, `found` are its modes, as the page gets
    them.  It was listened to for `allow_clipped`, at the last of its `attempts`.
    """

    identifier: str
    file: str
    phase: str = "waiting"
    message: str | None = None
    progress: float | None = None
    found: dict[str, Any] | None = None
    allow_clipped: bool = False
    attempts: int = 0

    def become(self, phase: str, message: str | None = None) -> None:
        """Begin a phase; news of an attempt before it do not count any more."""
        self.phase, self.message, self.progress = phase, message, None
        self.attempts += 1


class Clips:
    """All clips that a studio knows, the process that finds their modes, and one that plays them.

    `path` leads to a file of the workspace; `changed` is called when something else is known of a
    clip, `told` when a search for modes has come further.
    """

    def __init__(
        self,
        path: Callable[[str], Path],
        changed: Callable[[], None],
        told: Callable[[], None],
    ) -> None:
        self._path, self._changed, self._told = path, changed, told
        self._worker, self._player = (Worker("studio.processes.clips:ClipsBench") for _ in range(2))
        self._known: dict[str, Clip] = {}
        self._tasks: set[asyncio.Task[None]] = set()

    def end(self) -> None:
        """End the processes."""
        for task in self._tasks:
            task.cancel()
        self._worker.end()
        self._player.end()

    @property
    def are_listened_to(self) -> bool:
        """Whether the modes of some clip are being found."""
        return any(clip.phase == "listening" for clip in self._known.values())

    def add(self, file: str) -> Clip:
        """The clip in a file, known from now on."""
        if file not in self._known:
            self._known[file] = Clip(f"c{len(self._known) + 1}", file)
        return self._known[file]

    def named(self, identifier: str) -> Clip:
        """The clip that the page names; raises NotFoundError if there is none."""
        for clip in self._known.values():
            if clip.identifier == identifier:
                return clip
        raise NotFoundError(f"there is no clip {identifier!r}; add it again")

    def listen(self, targets: Iterable[Target]) -> list[Target]:
        """Targets whose clips have been listened to; begin with those that have not."""
        heard = []
        for target in targets:
            if target.clip is None:
                continue
            clip = self.add(target.clip)
            if clip.phase == "waiting" or clip.allow_clipped != target.allow_clipped:
                clip.become("listening")
                clip.allow_clipped = target.allow_clipped
                task = asyncio.ensure_future(self._listen(clip))
                self._tasks.add(task)
                task.add_done_callback(self._tasks.discard)
            if clip.phase == "ready":
                heard.append(target)
        return heard

    def stop(self, identifier: str) -> None:
        """End the search for a clip's modes; those of other clips that go on begin anew.

        Raises NotFoundError if there is no such clip, and UserError if there is nothing to end.
        """
        stopped = self.named(identifier)
        if stopped.phase != "listening":
            raise UserError(f"{stopped.file}: its modes are not being sought; nothing is stopped")
        for clip in self._known.values():
            if clip.phase == "listening":
                clip.become("waiting")
        stopped.become("stopped", STOPPED)
        self._worker.end()
        self._changed()

    def begin_again(self, identifier: str) -> None:
        """Find the modes of a clip whose search was stopped; raises NotFoundError as `named`."""
        clip = self.named(identifier)
        if clip.phase == "stopped":
            clip.become("waiting")
            self._changed()

    async def _listen(self, clip: Clip) -> None:
        attempt = clip.attempts

        def tell(news: tuple[str, float | None]) -> None:
            if clip.attempts == attempt:
                clip.message, clip.progress = news
                self._told()

        found, message = None, None
        try:
            found = await self._worker.call(
                "listen", self._file(clip), seconds=LISTENING_SECONDS, tell=tell
            )
        except UserError as error:
            message = str(error)
        if clip.attempts == attempt:
            clip.found = found
            clip.become("failed" if found is None else "ready", message)
            self._changed()

    async def part(self, identifier: str, part: str) -> bytes:
        """A clip's part as the content of a WAV file."""
        content: bytes = await self._player.call("part", self._file(self.named(identifier)), part)
        return content

    async def spectrum(self, identifier: str) -> dict[str, list[float]]:
        """A clip's spectrum."""
        partials: dict[str, list[float]]
        partials = await self._player.call("spectrum", self._file(self.named(identifier)))
        return partials

    def state(self) -> list[dict[str, Any]]:
        """All clips, as the page gets them."""
        return [
            {
                "clip": clip.identifier,
                "name": Path(clip.file).name,
                "phase": clip.phase,
                "message": clip.message,
                "progress": clip.progress,
                **(clip.found or _NOTHING),
            }
            for clip in self._known.values()
        ]

    def _file(self, clip: Clip) -> ClipFile:
        return ClipFile(str(self._path(clip.file)), clip.allow_clipped)
