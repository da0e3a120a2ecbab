"""The studio as its server sees it: a state, what follows it, and what pages ask of it."""

import asyncio
from collections.abc import Mapping
from typing import Any

from studio.interface import Download, NotFoundError
from studio.processes.worker import Worker
from studio.session.document import Document
from studio.session.handlers import handle
from studio.session.heads import strike_of
from studio.session.projects import designed
from studio.session.reconcile import Reconciler
from studio.session.snapshot import session_of, state_event
from studio.session.state import StudioState
from studio.session.workspace import Workspace

EXPORT_SECONDS = 600.0
"""Longest time of an export."""
MEDIA_TYPES = {
    "h5": "application/x-hdf5",
    "gltf": "model/gltf+json",
    "glb": "model/gltf-binary",
    "dsp": "text/plain",
    "npy": "application/octet-stream",
    "wav": "audio/wav",
    "html": "text/html",
    "zip": "application/zip",
}
"""Media type of a file by its ending."""


class DesignStudio:
    """The studio in a workspace, see `studio.interface.Studio`: its state is `session`, which the
    reconciler follows.
    """

    def __init__(self, workspace: Workspace, name: str, document: Document) -> None:
        self.session = StudioState(workspace, name, document, state_event, session_of)
        self.reconciler = Reconciler(self.session)
        pages, clips = self.session.pages, self.session.clips
        self.subscribe, self.unsubscribe = pages.subscribe, pages.unsubscribe
        self.clip_sound, self.clip_spectrum = clips.part, clips.spectrum
        self._exports = Worker("studio.processes.exports:Exports")
        self._saving: asyncio.Future[None] | None = None

    async def start(self) -> None:
        """Begin to keep up with the document."""
        self._saving = asyncio.ensure_future(self.session.autosave.run())
        self.reconciler.start()

    def state(self) -> dict[str, Any]:
        """The event `state`."""
        return state_event(self.session)

    async def call(self, name: str, arguments: Mapping[str, Any]) -> None:
        """Do what the page asks for."""
        await handle(self.session, name, arguments)

    async def take_mesh(self, name: str, content: bytes) -> str:
        """Put an uploaded mesh into the workspace."""
        file, meshes = self.session.workspace.put(name, content), self.session.meshes
        for identifier, known in meshes.items():
            if known == file:
                return identifier
        identifier = f"m{len(meshes) + 1}"
        meshes[identifier] = file
        return identifier

    async def take_clip(self, name: str, content: bytes) -> str:
        """Put an uploaded clip into the workspace."""
        clip = self.session.clips.add(self.session.workspace.put(name, content))
        self.session.changed()
        return clip.identifier

    async def surface(self, number: int) -> bytes:
        """The surface, if it still is that one."""
        surface = self.session.solid.surface
        if surface is None or surface[0] != number:
            raise NotFoundError(f"there is no surface {number} any more; load the page anew")
        return surface[1]

    async def composition(self, number: int) -> bytes:
        """Regions and supports on the surface, if they still are those."""
        message = self.session.placing.message
        if message is None or self.session.placing.number != number:
            raise NotFoundError(f"there is no composition {number} any more; load the page anew")
        return message

    async def export(self, kind: str, target: str | None) -> Download:
        """The design in another form."""
        design, name = await designed(self.session), self.session.name
        with self.session.workspace.exporting() as folder:
            out = folder / f"export.{kind}"
            await self._exports.call(
                "make", design, kind, target, str(out), name, seconds=EXPORT_SECONDS
            )
            content = out.read_bytes()
        stem = name if target is None or kind != "wav" else f"{name}-{target}"
        return Download(f"{stem}.{kind}", MEDIA_TYPES[kind], content)

    async def head_sound(self, number: int, part: str, stimulus: str) -> bytes:
        """A sound of a comparison of heads."""
        state = self.session
        strike = strike_of(state.pages.bank) if stimulus == "strike" else None
        return await state.heads.sound(number, part, strike)

    async def close(self) -> None:
        """Save what is to be saved and end all processes."""
        state = self.session
        if self._saving is not None:
            self._saving.cancel()
            await asyncio.gather(self._saving, return_exceptions=True)
        state.autosave.save()
        await self.reconciler.end()
        state.workspace.forget_designs(state.history.designs())
        for each in (
            state.solid,
            state.placing,
            state.clips,
            state.heads,
            state.search,
            self._exports,
        ):
            each.end()
        state.pages.close()
        state.workspace.close()
