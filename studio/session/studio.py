"""The studio: what is designed, what computes, and what pages are told of it."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import Any

from carillon.errors import UserError
from carillon.fem.geometry.builtin import BUILTINS
from sound.project.schema import project_schema, with_defaults
from studio.feed import Feed
from studio.interface import Download, NotFoundError
from studio.processes.worker import Worker
from studio.session.autosave import Autosave
from studio.session.calls import Calls
from studio.session.document import Document, Material
from studio.session.examples import EXAMPLES
from studio.session.history import History
from studio.session.listening import Clips
from studio.session.pages import Pages
from studio.session.reconcile import Upkeep
from studio.session.restoring import kept, restored, restored_name
from studio.session.searching import Searching
from studio.session.solid_client import Bench
from studio.session.workspace import Workspace

EXPORT_SECONDS = 600.0
"""That an export may take."""
MEDIA_TYPES = {
    "h5": "application/x-hdf5",
    "gltf": "model/gltf+json",
    "glb": "model/gltf-binary",
    "dsp": "text/plain",
    "npy": "application/octet-stream",
    "wav": "audio/wav",
    "html": "text/html",
}


class DesignStudio:
    """State of the studio, see `studio.interface.Studio`.

    Attributes
    ----------
    workspace, name
        Its folder, and the name of the project.
    history
        The document, with undo and redo.
    meshes
        Files of uploaded meshes by identifier.
    bench, clips, search
        What computes.
    """

    def __init__(self, workspace: Workspace, name: str, document: Document) -> None:
        self.workspace, self.name = workspace, name
        self.history = History(document)
        self.meshes: dict[str, str] = {}
        self.saved: Document | None = document
        self.fine = False
        self.is_searching = False
        self.pages = Pages(self.state, lambda: {"event": "history", "rows": self.search.rows})
        self.upkeep = Upkeep(self)
        self.bench = Bench(workspace.folder, self.changed)
        self.clips = Clips(workspace.path, self._clips_changed)
        self.search = Searching(self._told, self.upkeep.found)
        self.autosave = Autosave(self._session, workspace.write_session)
        self._exports = Worker("studio.processes.exports:Exports")
        self._saving: asyncio.Future[None] | None = None
        self._revision = 0
        self._phase = "idle"
        self._calls = Calls(self)

    @property
    def document(self) -> Document:
        """What is designed."""
        return self.history.document

    # What the server asks.

    async def start(self) -> None:
        """Begin to keep up with the document."""
        self._saving = asyncio.ensure_future(self.autosave.run())
        self.upkeep.start()

    def state(self) -> dict[str, Any]:
        """The event `state`."""
        self._phase = self.search.phase
        document, news = self.document, self.bench.news
        settings = with_defaults({**document.settings, "targets": []}, project_schema())
        return {
            "event": "state",
            "revision": self._revision,
            "name": self.name,
            "saved": self.saved == document,
            "workspace": self.workspace.folder.name,
            "undo": self.history.undo_name,
            "redo": self.history.redo_name,
            "solid": None if news is None else asdict(news),
            "targets": [self._target(each.name) for each in document.targets],
            "clips": self.clips.state(),
            "wanted": self.bench.wanted,
            "settings": {k: v for k, v in settings.items() if k not in ("mesh", "targets")},
            "search": {"phase": self._search_phase, "message": self.upkeep.message},
            "fine": {"on": self.fine, "phase": self.upkeep.fine_phase, "message": None},
            "heard": document.heard,
            "builtins": sorted(BUILTINS),
            "examples": [
                {"project": f"e{number}", "name": each.name, "says": each.says}
                for number, each in enumerate(EXAMPLES, start=1)
            ],
            "projects": [
                {"project": f"p{number}", "name": name}
                for number, name in enumerate(self.workspace.projects(), start=1)
            ],
        }

    @property
    def _search_phase(self) -> str:
        """That of the search; one that waits for the solid or for clips is starting, too."""
        is_waiting = self.is_searching and self.search.phase == "idle"
        return "starting" if is_waiting else self.search.phase

    def _target(self, name: str) -> dict[str, Any]:
        target, strike = self.document.target(name), self.bench.strikes.get(name)
        clip = None if target.clip is None else self.clips.add(target.clip).identifier
        return {
            "name": name,
            "vertex": target.vertex if strike is None else strike.vertex,
            "position_m": None if strike is None else strike.position.tolist(),
            "clip": clip,
            "modes": target.modes,
            "allow_clipped": target.allow_clipped,
            "without": list(target.without),
        }

    def subscribe(self) -> Feed:
        """A feed that begins with all that there is."""
        return self.pages.subscribe()

    def unsubscribe(self, feed: Feed) -> None:
        """Send nothing more to a feed."""
        self.pages.unsubscribe(feed)

    async def call(self, name: str, arguments: Mapping[str, Any]) -> None:
        """Do what the page asks for."""
        await self._calls.call(name, arguments)

    async def take_mesh(self, name: str, content: bytes) -> str:
        """Put an uploaded mesh into the workspace."""
        file = self.workspace.put(name, content)
        for identifier, known in self.meshes.items():
            if known == file:
                return identifier
        identifier = f"m{len(self.meshes) + 1}"
        self.meshes[identifier] = file
        return identifier

    async def take_clip(self, name: str, content: bytes) -> str:
        """Put an uploaded clip into the workspace."""
        clip = self.clips.add(self.workspace.put(name, content))
        self.changed()
        return clip.identifier

    async def surface(self, number: int) -> bytes:
        """The surface, if it still is that one."""
        if self.bench.surface is None or self.bench.surface[0] != number:
            raise NotFoundError(f"there is no surface {number} any more; load the page anew")
        return self.bench.surface[1]

    async def clip_sound(self, clip: str, part: str) -> bytes:
        """A clip or a part of it."""
        return await self.clips.part(clip, part)

    async def clip_spectrum(self, clip: str) -> dict[str, list[float]]:
        """A clip's spectrum."""
        return await self.clips.spectrum(clip)

    async def export(self, kind: str, target: str | None) -> Download:
        """The design in another form."""
        design = await self.designed()
        with self.workspace.exporting() as folder:
            out = folder / f"export.{kind}"
            await self._exports.call("make", design, kind, target, str(out), seconds=EXPORT_SECONDS)
            content = out.read_bytes()
        stem = self.name if target is None or kind != "wav" else f"{self.name}-{target}"
        return Download(f"{stem}.{kind}", MEDIA_TYPES[kind], content)

    async def close(self) -> None:
        """Save what is to be saved and end all processes."""
        if self._saving is not None:
            self._saving.cancel()
            await asyncio.gather(self._saving, return_exceptions=True)
        self.autosave.save()
        await self.upkeep.end()
        self.workspace.forget_designs(self.history.designs())
        self.bench.end()
        self.clips.end()
        self.search.end()
        self._exports.end()
        self.pages.close()
        self.workspace.close()

    # What calls do.

    def do(self, name: str, document: Document) -> None:
        """Go on to another document; a search that goes on begins anew with it."""
        document.require_sound(self.workspace.folder)
        self.upkeep.break_off()
        self.history.do(name, self._with_materials_of_its_own(document))
        self._edited()

    def move(self, forwards: bool) -> None:
        """Redo or undo."""
        self.is_searching = False
        self.upkeep.break_off()
        if not (self.history.redo() if forwards else self.history.undo()):
            raise UserError(f"there is nothing to {'redo' if forwards else 'undo'}")
        self._edited()

    def open(self, name: str, document: Document) -> None:
        """Begin with another project."""
        document.require_sound(self.workspace.folder)
        self.is_searching = False
        self.upkeep.break_off()
        self.name, self.fine = name, False
        self.search.forget()
        self.pages.tell_history()
        self.history.do(f"open {name}", document)
        self._edited()

    def begin_search(self) -> None:
        """Search from now on, as soon as the solid and the clips are ready."""
        if self.is_searching:
            return
        if not any(target.clip for target in self.document.targets):
            raise UserError("no target has a clip yet; place one and drop a clip on it")
        self.is_searching = True
        self.history.do("optimise", self.document)
        self.changed()
        self.upkeep.wake()

    def stop_search(self) -> None:
        """Stop searching at once; what was found stays, and is analysed to the end."""
        self.is_searching = False
        self.upkeep.stop()
        self.changed()

    def is_saved_as(self, name: str) -> None:
        """Take note that the document was saved."""
        self.name, self.saved = name, self.document
        self.changed()

    def show_fine(self, on: bool) -> None:
        """Show the fine solid, or the one of the search."""
        self.fine = on
        self.changed()
        self.upkeep.wake()

    async def designed(self) -> str:
        """The file of the present material's design, which is made if there is none.

        Raises
        ------
        UserError
            If there is nothing to make one of.
        """
        if self.is_searching:
            raise UserError("the search goes on; stop it first")
        if self.bench.project is None:
            raise UserError("there is no target with a clip yet, and so no design")
        material = self.document.material
        given: str | list[float] | None = None
        rows = []
        if material is not None and material.design is None:
            given, rows = list(material.z), self.search.rows
        elif material is not None:
            given = material.design
            if await self.bench.ask("is_of_targets", given):
                return str(given)
        out = str(self.workspace.new_design())
        made = Material(tuple(await self.bench.ask("design", given, out, rows)), out)
        if self.document.material == material:
            self.history.replace(replace(self.document, material=made))
            self.changed()
        return out

    def _with_materials_of_its_own(self, document: Document) -> Document:
        """An edited document without materials of another solid, which mean nothing on it."""
        before = self.document
        solid, former = (
            {key: each.settings.get(key) for key in _OF_VOXELS} for each in (document, before)
        )
        if solid != former:
            return replace(document, material=None, kept=None, heard=None)
        law, known = ({**each.settings.get("material", {})} for each in (document, before))
        if any(law.get(key) != known.get(key) for key in _OF_COORDINATES):
            if document.material is not None and document.material.design is None:
                document = replace(document, material=None)
            if document.kept is not None and document.kept.design is None:
                document = replace(document, kept=None, heard=None)
        return document

    def _edited(self) -> None:
        news = self.bench.news
        if news is not None and news.phase in ("reading", "preparing"):
            if news.mesh != self.document.mesh:
                self.bench.end()
        self.changed()
        self.upkeep.wake()

    def changed(self) -> None:
        """Tell all pages the state, and save it soon."""
        self._revision += 1
        self.pages.tell_state()
        self.autosave.soon()

    def _clips_changed(self) -> None:
        self.changed()
        self.upkeep.wake()

    def _told(self, news: dict[str, Any]) -> None:
        if self._phase != self.search.phase:
            self.changed()
        self.pages.tell({"event": "progress", **news})

    def _session(self) -> dict[str, Any]:
        """What the studio goes on with when it is started again."""
        return {
            "name": self.name,
            "saved": self.saved == self.document,
            "searching": self.is_searching,
            "fine": self.fine,
            "history": kept(self.history, self.workspace),
        }

    def restore(self, session: Mapping[str, Any]) -> None:
        """Go on with what `_session` told.

        Raises
        ------
        OutsideError
            If it names files outside of the workspace.
        LookupError, TypeError, ValueError, AttributeError, ArithmeticError, UserError
            If it is none.
        """
        name, history = restored_name(session["name"]), restored(session["history"], self.workspace)
        saved, fine = bool(session["saved"]), bool(session["fine"])
        self.is_searching = bool(session["searching"])
        self.name, self.fine = name, fine
        self.history, self.saved = history, history.document if saved else None


_OF_VOXELS = ("mesh", "unit", "resolution", "fill", "components", "discretisation")
"""Keys of a project whose change makes other voxels, for which no former material is one."""
_OF_COORDINATES = ("dimensions", "law", "poisson_bounds")
"""Keys of its material whose change makes coordinates mean something else."""
