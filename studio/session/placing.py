"""Where regions and supports are on the surface, from a process that does not wait for voxels."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from studio.processes.worker import Worker
from studio.rows import KINDS, rows_of
from studio.session.document import Document

SECONDS = 60.0
"""Longest time to read a mesh and the meshes of regions."""


class Placing:
    """Places of a document's regions and supports.

    `changed` is called when they are others.  Their binary `message` has a `number`; both are None
    without rows.  `faults` are what is wrong with rows, by kind and number.
    """

    def __init__(self, folder: Path, changed: Callable[[], None]) -> None:
        self._folder, self._changed = folder, changed
        self._worker = Worker("studio.processes.composition:PlacingProcess")
        self._numbers = 0
        self._placed: Any = None
        self._forget()

    def _forget(self) -> None:
        self.number: int | None = None
        self.message: bytes | None = None
        self.faults: dict[tuple[str, int], str] = {}

    def end(self) -> None:
        """End the process."""
        self._worker.end()

    async def bring(self, document: Document) -> None:
        """Bring the places to what a document describes.

        Raises UserError if there are none to be found: the mesh cannot be read, for instance.
        """
        rows = {kind: rows_of(document.settings, kind) for kind in KINDS}
        if document.mesh is None or not any(rows.values()):
            if self.number is not None:
                self._forget()
                self._changed()
            self._placed = None
            return
        solid = document.solid(self._folder).solid
        wanted = solid.mesh, solid.unit, rows, solid.wall_size, solid.up
        if wanted == self._placed:
            return
        self._numbers += 1
        try:
            self.message, self.faults = await self._worker.call(
                "place", *wanted, self._folder, self._numbers, seconds=SECONDS
            )
        finally:
            self._placed = wanted
        self.number = self._numbers
        self._changed()
