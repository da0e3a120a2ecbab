"""The studio: what is designed, what computes, and what pages are told of it."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, replace
from typing import Any

from carillon.errors import UserError
from carillon.fem.geometry.builtin import BUILTINS
from sound.project.schema import project_schema, with_defaults
from studio.feed import Feed
from studio.interface import Download, NotFoundError
from studio.processes.worker import Worker
from studio.session.autosave import Autosave
from studio.session.bench import Bench
from studio.session.calls import Calls
from studio.session.document import Document, Material
from studio.session.examples import EXAMPLES
from studio.session.history import History
from studio.session.listening import Clips
from studio.session.searching import Live, Searching
from studio.session.workspace import Workspace

BANK_SECONDS = 0.25
"""Time between two banks of a search."""
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
logger = logging.getLogger(__name__)


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
        self.bench = Bench(workspace.folder, self._changed)
        self.clips = Clips(workspace.path, self._clips_changed)
        self.search = Searching(self._told, self._found)
        self._exports = Worker("studio.processes.exports:Exports")
        self._feeds: set[Feed] = set()
        self._revision = 0
        self._bank: tuple[Any, bytes] | None = None
        self._banks = 0
        self._fine_phase = "none"
        self._search_message: str | None = None
        self._live: Live | None = None
        self._wake, self._lively = asyncio.Event(), asyncio.Event()
        self._search_task: asyncio.Task[None] | None = None
        self._autosave = Autosave(self._session, workspace.write_session)
        self._tasks: list[asyncio.Future[None]] = []
        self._calls = Calls(self)

    @property
    def document(self) -> Document:
        """What is designed."""
        return self.history.document

    # What the server asks.

    async def start(self) -> None:
        """Begin to keep up with the document."""
        work = (self._keep_up(), self._follow(), self._autosave.run())
        self._tasks = [asyncio.ensure_future(each) for each in work]
        self.bench.warm()
        self._wake.set()

    def state(self) -> dict[str, Any]:
        """The event `state`."""
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
            "search": {"phase": self._search_phase, "message": self._search_message},
            "fine": {"on": self.fine, "phase": self._fine_phase, "message": None},
            "kept": document.kept is not None,
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
        feed = Feed()
        self._feeds.add(feed)
        feed.send(self.state(), "state")
        feed.send(self._history_event())
        if self._bank is not None:
            feed.put(self._bank[1], "bank")
        return feed

    def unsubscribe(self, feed: Feed) -> None:
        """Send nothing more to a feed."""
        self._feeds.discard(feed)

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
        self._changed()
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
        out = self.workspace.temporary(f"export.{kind}")
        try:
            await self._exports.call("make", design, kind, target, str(out), seconds=EXPORT_SECONDS)
            content = out.read_bytes()
        finally:
            out.unlink(missing_ok=True)
        stem = self.name if target is None or kind != "wav" else f"{self.name}-{target}"
        return Download(f"{stem}.{kind}", MEDIA_TYPES[kind], content)

    async def close(self) -> None:
        """Save what is to be saved and end all processes."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._autosave.save()
        self.workspace.forget_designs(self.history.designs())
        self.search.break_off()
        if self._search_task is not None:
            await asyncio.gather(self._search_task, return_exceptions=True)
        self.bench.end()
        self.clips.end()
        self._exports.end()
        for feed in self._feeds:
            feed.close()
        self.workspace.close()

    # What calls do.

    def do(self, name: str, document: Document) -> None:
        """Go on to another document; a search that goes on begins anew with it."""
        document.require_sound(self.workspace.folder)
        self._settle()
        changed = replace(document, material=self._material_of(document))
        self.history.do(name, changed)
        self._edited()

    def move(self, forwards: bool) -> None:
        """Redo or undo."""
        self.is_searching = False
        self._settle()
        if not (self.history.redo() if forwards else self.history.undo()):
            raise UserError(f"there is nothing to {'redo' if forwards else 'undo'}")
        self._edited()

    def open(self, name: str, document: Document) -> None:
        """Begin with another project."""
        document.require_sound(self.workspace.folder)
        self.is_searching = False
        self._settle()
        self.name, self.fine = name, False
        self.history.do(f"open {name}", document)
        self._edited()

    def begin_search(self) -> None:
        """Search from now on, as soon as the solid and the clips are ready."""
        if self.is_searching:
            return
        if not any(target.clip for target in self.document.targets):
            raise UserError("no target has a clip yet; place one and drop a clip on it")
        self.is_searching, self._search_message = True, None
        self.history.do("optimise", self.document)
        self._changed()
        self._wake.set()

    async def stop_search(self) -> None:
        """Stop searching; what was found stays."""
        self.is_searching = False
        self._changed()
        await self.search.stop()

    def is_saved_as(self, name: str) -> None:
        """Take note that the document was saved."""
        self.name, self.saved = name, self.document
        self._changed()

    def show_fine(self, on: bool) -> None:
        """Show the fine solid, or the one of the search."""
        self.fine = on
        self._changed()
        self._wake.set()

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
        if material is not None and material.design is not None:
            return material.design
        out = str(self.workspace.new_design())
        z = None if material is None else list(material.z)
        await self.bench.ask("design", z, out)
        made = Material(() if z is None else tuple(z), out)
        self.history.replace(replace(self.document, material=made))
        self._changed()
        return out

    def _material_of(self, document: Document) -> Material | None:
        """The material that an edited document keeps: that of another solid means nothing."""
        before = self.document
        solid, former = (
            {key: each.settings.get(key) for key in _OF_VOXELS} for each in (document, before)
        )
        if solid != former:
            return None
        law, known = ({**each.settings.get("material", {})} for each in (document, before))
        material = document.material
        if material is not None and material.design is None:
            if any(law.get(key) != known.get(key) for key in _OF_COORDINATES):
                return None
        return material

    def _settle(self) -> None:
        """End a search that goes on; its best material is that of the document by now."""
        if self.search.phase != "idle":
            self.search.break_off()
        self._live = None

    def _edited(self) -> None:
        self._search_message = None
        news = self.bench.news
        if news is not None and news.phase in ("reading", "preparing"):
            if news.mesh != self.document.mesh:
                self.bench.end()
        self._changed()
        self._wake.set()

    # What goes on behind.

    async def _keep_up(self) -> None:
        """Bring all that computes to what the document describes, again and again."""
        while True:
            await self._wake.wait()
            self._wake.clear()
            document = self.document
            try:
                await self._bring(document)
            except UserError as error:
                if document is self.document:
                    self.say(str(error), "error")
            except Exception:
                logger.exception("the studio could not keep up")
                self.say("this failed for a fault of the program; its terminal tells more", "error")

    async def _bring(self, document: Document) -> None:
        heard = self.clips.listen(document.targets)
        try:
            await self.bench.bring(document, heard)
        except UserError as error:
            # Of the solid alone there is something to hear, even where the clips are no good.
            if document is self.document and not self.clips.are_listened_to:
                self._end_search(str(error))
            if not self.bench.is_ready:
                return
        if document is not self.document or heard != self.clips.listen(document.targets):
            self._wake.set()
            return
        if self.is_searching and not self.clips.are_listened_to:
            self._start_search()
        if self.search.phase == "idle":
            await self._show(document)
            self.search.warm()

    async def _show(self, document: Document) -> None:
        """Send the bank of the document's material, unless it is the last one that was sent."""
        if not self.bench.is_ready:
            return
        material, fine = document.material, self.fine
        shown = (material, fine, self.bench.aimed)
        if self._bank is not None and self._bank[0] == shown:
            return
        self._fine_phase = "working" if fine else "none"
        if fine:
            self._changed()
        try:
            name = "fine_bank" if fine else "bank"
            given: str | list[float] | None = None
            if material is not None and material.design is not None:
                name, given = f"{name}_of", material.design
            elif material is not None:
                given = list(material.z)
            message = await self.bench.ask(name, given, self._header(fine))
        finally:
            self._fine_phase = "ready" if fine else "none"
        self._publish_bank(shown, message)
        self._changed()

    def _header(self, fine: bool) -> dict[str, Any]:
        self._banks += 1
        surface = None if self.bench.surface is None else self.bench.surface[0]
        return {"number": self._banks, "surface": surface, "fine": fine}

    def _start_search(self) -> None:
        if self._search_task is not None and not self._search_task.done():
            return
        if self.bench.project is None:
            self._end_search("no clip could be listened to; see what its target says")
            return
        self._search_task = asyncio.ensure_future(self._search())

    async def _search(self) -> None:
        """One search, from the document's material until it ends or is broken off."""
        try:
            problem = await self.bench.ask("problem")
            running = self.search.run(problem, self.document.material, self.workspace.new_design())
            found = await running
        except UserError as error:
            self._end_search(str(error))
        else:
            if found is not None:
                self.is_searching = False
                self.history.replace(replace(self.document, material=found))
        self._live = None
        self._publish(self._history_event())
        self._changed()
        self._wake.set()

    def _end_search(self, sentence: str) -> None:
        """Tell why there is no search, and want none any more."""
        if self.is_searching:
            self.is_searching, self._search_message = False, sentence
        self._changed()
        self.say(sentence, "error")

    def _told(self, news: dict[str, Any]) -> None:
        if len(self.search.rows) == 1:
            self._changed()  # it is running
        self._publish({"event": "progress", **news})

    def _found(self, live: Live) -> None:
        self._live = live
        self.history.replace(replace(self.document, material=live.material))
        self._autosave.soon(seconds=2.0)
        self._lively.set()

    async def _follow(self) -> None:
        """Send banks of a search that goes on: of its newest material, as often as may be."""
        while True:
            await self._lively.wait()
            self._lively.clear()
            live = self._live
            if live is None:
                continue
            with suppress(UserError):
                header = {**self._header(False), "cost": live.cost}
                message = await self.bench.ask("bank", list(live.material.z), header, live.hertz)
                if self._live is not None:
                    self._publish_bank(None, message)
            await asyncio.sleep(BANK_SECONDS)

    # What pages are told.

    def say(self, text: str, kind: str = "note") -> None:
        """Tell all pages a sentence; `kind` is `note` or `error`."""
        self._publish({"event": "said", "text": text, "kind": kind})

    def _clips_changed(self) -> None:
        self._changed()
        self._wake.set()

    def _changed(self) -> None:
        self._revision += 1
        state = self.state()
        for feed in self._feeds:
            feed.send(state, "state")
        self._autosave.soon()

    def _publish_bank(self, shown: Any, message: bytes) -> None:
        self._bank = (shown, message)
        for feed in self._feeds:
            feed.put(message, "bank")

    def _publish(self, event: dict[str, Any]) -> None:
        for feed in self._feeds:
            feed.send(event)

    def _history_event(self) -> dict[str, Any]:
        return {"event": "history", "rows": self.search.rows}

    def _session(self) -> dict[str, Any]:
        """What the studio goes on with when it is started again."""
        return {
            "name": self.name,
            "searching": self.is_searching,
            "fine": self.fine,
            "history": self.history.as_json(),
        }

    def restore(self, session: Mapping[str, Any]) -> None:
        """Go on with what `_session` told.

        Raises
        ------
        LookupError, TypeError, ValueError, UserError
            If it is none.
        """
        history = History.from_json(session["history"])
        history.document.require_sound(self.workspace.folder)
        self.history, self.saved = history, None
        self.is_searching = bool(session["searching"])
        self.fine = bool(session["fine"])


_OF_VOXELS = ("mesh", "unit", "resolution", "fill", "components", "discretisation")
"""Keys of a project whose change makes other voxels, for which no former material is one."""
_OF_COORDINATES = ("dimensions", "law", "poisson_bounds")
"""Keys of its material whose change makes coordinates mean something else."""
