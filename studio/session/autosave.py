"""Saves the session soon after each change, so that nothing is lost when all ends at once."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from carillon.command_line.progress import say
from carillon.errors import UserError

SOON_SECONDS = 0.3
"""Time between a change and its saving; more changes may come together."""


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
