"""The solid in its process, kept as a document describes it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from carillon.errors import UserError
from carillon.fem.geometry.hints import MeshHints
from carillon.fem.geometry.surface import surface_name
from carillon.fem.geometry.walls import WallSize
from sound.project.project import Project
from sound.strikes import Place, Strike
from studio.processes.worker import Worker
from studio.session.document import Document, Target

READ_SECONDS = 60.0
"""Longest time to read a mesh."""
PREPARED_SECONDS = 1800.0
"""Longest time to prepare a solid; the finest resolution takes minutes."""


@dataclass(frozen=True)
class SolidNews:
    """The solid as the page gets it, see docs/contributing/studio.md."""

    mesh: str
    name: str
    phase: str
    progress: float | None = None
    message: str | None = None
    surface: int | None = None
    vertices: int | None = None
    triangles: int | None = None
    voxels: int | None = None
    unknowns: int | None = None
    longest_side_m: float | None = None
    extents_m: tuple[float, float, float] | None = None
    units: tuple[dict[str, Any], ...] = ()
    """Other units that it may be in: `name`, `metres` and `longest_m`, the likeliest first."""
    up: str | None = None
    """Axis of the mesh that seems to point up; None if z does."""
    shell_m: float | None = None
    """Thickness that a shell of the mesh might have, if that is open and filled."""


def _told(hints: MeshHints) -> dict[str, Any]:
    longest = max(hints.extents)
    units = (
        {"name": name, "metres": metres, "longest_m": longest / hints.unit * metres}
        for name, metres in hints.units.items()
    )
    return {
        "longest_side_m": longest,
        "extents_m": hints.extents,
        "units": tuple(units),
        "up": hints.up,
        "shell_m": hints.shell,
    }


class SolidClient:
    """The solid that a process computes with, and what is known of it.

    Paths of documents begin at `folder`; `changed` is called when there is something else to be
    shown.  `news` is what is shown of the solid, if there is one; `surface` has the number and the
    binary message of its surface.  If there are targets, `strikes` are the points of these by their
    names, `wanted` the modes that all clips share, and `project` is what the solid aims at.
    """

    def __init__(self, folder: Path, changed: Callable[[], None]) -> None:
        self._folder, self._changed = folder, changed
        self._worker = Worker("studio.processes.solid:SolidProcess")
        self._numbers = 0
        self._forget()

    def _forget(self) -> None:
        self.news: SolidNews | None = None
        self.surface: tuple[int, bytes] | None = None
        self.strikes: dict[str, Strike] = {}
        self.wanted: dict[str, Any] | None = None
        self.project: Project | None = None
        self._read: tuple[str, float, WallSize | None, str | None] | None = None
        self._prepared: Any = None
        self._aimed: Any = None
        self._placed: tuple[Target, ...] | None = None

    def warm(self) -> None:
        """Start the process, so that a solid is there sooner."""
        self._worker.start()

    @property
    def aimed(self) -> Any:
        """What the solid is, and what it aims at: another value whenever that changes."""
        return (self._read, self._prepared, self._aimed)

    @property
    def is_ready(self) -> bool:
        """Whether the solid can be struck."""
        return self.news is not None and self.news.phase == "ready"

    def end(self) -> None:
        """End the process, whatever it does."""
        self._worker.end()
        self._forget()

    async def bring(self, document: Document, heard: Sequence[Target]) -> None:
        """Bring the solid to what a document describes, with the targets whose clips were heard.

        Raises UserError if it cannot be.  The news then tell it, too, or the solid is there without
        an aim.
        """
        if document.mesh is None:
            self.end()
            return
        if self._worker.pid is None:  # which knew all that was brought
            self._forget()
        try:
            project = document.solid(self._folder)
            solid, material = project.solid, project.material
            await self._bring_surface(document.mesh, project)
            await self._bring_voxels(solid, material, project.composition)
        except UserError as error:
            self._tell(phase="failed", message=str(error), progress=None)
            self._prepared = self._aimed = None
            raise
        await self._bring_strikes(document)
        await self._bring_aim(document, heard)

    async def ask(self, name: str, *arguments: Any) -> Any:
        """Call the process, see `studio.processes.solid.SolidProcess`."""
        return await self._worker.call(name, *arguments)

    async def _bring_surface(self, mesh: str, project: Project) -> None:
        solid = project.solid
        how = solid.unit, solid.wall_size, solid.up
        wanted = mesh, *how
        if self._read == wanted:
            return
        self._forget()
        self.news = SolidNews(mesh, surface_name(mesh), "reading")
        self._changed()
        self._numbers += 1
        result = await self._worker.call(
            "read", solid.mesh, *how, self._numbers, seconds=READ_SECONDS
        )
        self.surface, self._read = (self._numbers, result.message), wanted
        self._tell(
            surface=self._numbers,
            vertices=result.vertices,
            triangles=result.triangles,
            **_told(result.hints),
        )

    async def _bring_voxels(self, *prepared: Any) -> None:
        if self._prepared == prepared:
            return
        self._aimed = self._placed = None
        self.project = self.wanted = None
        self._tell(phase="preparing", message=None)
        result = await self._worker.call("prepare", *prepared, seconds=PREPARED_SECONDS)
        self._prepared = prepared
        self._tell(phase="ready", message=None, progress=None, **result)

    async def _bring_strikes(self, document: Document) -> None:
        if self._placed == document.targets:
            return
        places = [Place(each.name, each.at, each.vertex) for each in document.targets]
        strikes = await self._worker.call("place", places) if places else []
        self.strikes = {strike.name: strike for strike in strikes}
        self._placed = document.targets
        self._changed()

    async def _bring_aim(self, document: Document, heard: Sequence[Target]) -> None:
        project = None
        if heard:
            project = replace(document, targets=tuple(heard)).project(self._folder)
        if self._aimed == (project,):
            return
        self.wanted = self.project = self._aimed = None
        try:
            self.wanted = await self._worker.call("aim", project)
            self.project, self._aimed = project, (project,)
        finally:
            self._changed()

    def _tell(self, **changes: Any) -> None:
        if self.news is not None:
            self.news = replace(self.news, **changes)
            self._changed()
