"""What a studio is about: the document, what computes, and who is told of it."""

import asyncio
from collections.abc import Callable
from dataclasses import replace
from typing import Any

from carillon.errors import UserError
from studio.feed import Pages
from studio.session.document import Document, History
from studio.session.heads import Heads
from studio.session.listening import Clips
from studio.session.placing import Placing
from studio.session.restoring import Autosave
from studio.session.searching import Live, Searching
from studio.session.solid_client import SolidClient
from studio.session.workspace import Workspace

SAVED_SECONDS = 2.0
"""Time within which a material that a search has found is saved."""
Told = Callable[["StudioState"], dict[str, Any]]
"""Function that describes a state: to pages, or for the file of the session."""
_OF_VOXELS = (
    *("mesh", "unit", "up", "resolution", "fill", "components", "discretisation"),
    *("wall", "wall_side"),
)
"""Keys of a project whose change makes other voxels, for which no former material is one."""
_OF_COORDINATES = (
    "dimensions",
    "law",
    "poisson_bounds",
    "poisson_regions",
    "density_bounds",
    "density_regions",
)
"""Keys of its material whose change makes coordinates mean something else."""


class StudioState:
    """State that the calls of the page change and that `Reconciler` brings solid and sound to.

    Parameters
    ----------
    event, session
        What pages are told of the state, and what is kept of it; see `studio.session.snapshot`.

    Attributes
    ----------
    history, saved, meshes
        The document, with undo and redo, and as it was saved last; files of uploaded meshes by
        identifier.
    solid, placing, clips, heads, search, live
        What computes, and the newest material of a search that goes on.
    shows_fine, fine_phase
        Whether the fine solid is to be shown; `none`, `working` or `ready`.
    is_searching, is_finishing, message
        Whether a search is to go on; whether a design is being made of what a stopped search has
        found; why there is no search, if there was to be one.
    revision
        Number of changes that pages were told.
    woken, placed, improved
        Set when the document has changed, for what computes and for what places rows, and when
        `live` has.
    """

    def __init__(
        self, workspace: Workspace, name: str, document: Document, event: Told, session: Told
    ) -> None:
        self.workspace, self.name = workspace, name
        self.history = History(document)
        self.meshes: dict[str, str] = {}
        self.saved: Document | None = document
        self.shows_fine = self.is_searching = self.is_finishing = False
        self.fine_phase = "none"
        self.message: str | None = None
        self.live: Live | None = None
        self.revision = 0
        self.woken, self.placed, self.improved = (asyncio.Event() for _ in range(3))
        self.pages = Pages(lambda: event(self), self._history_event)
        self.autosave = Autosave(lambda: session(self), workspace.write_session)
        self.solid = SolidClient(workspace.folder, self.changed)
        self.placing = Placing(workspace.folder, self.changed)
        self.clips = Clips(workspace.path, self.changed_and_woken, self.changed)
        self.heads = Heads(workspace, self.changed)
        self.search = Searching(self._progressed, self._found)
        self._phase = self.search.phase

    @property
    def document(self) -> Document:
        """What is designed."""
        return self.history.document

    # Telling.

    def changed(self) -> None:
        """Tell all pages the state, and save it soon."""
        self.revision += 1
        self._phase = self.search.phase
        self.pages.tell_state()
        self.autosave.soon()

    def changed_and_woken(self) -> None:
        """Tell all pages the state, and bring solid, clips and search to the document."""
        self.changed()
        self.woken.set()
        self.placed.set()

    def _history_event(self) -> dict[str, Any]:
        return {"event": "history", "rows": self.search.rows, "checks": self.search.checks}

    def _progressed(self, news: dict[str, Any]) -> None:
        if self._phase != self.search.phase:
            self.changed()
        self.pages.tell({"event": "progress", **news})

    def _found(self, live: Live) -> None:
        self.live = live
        self.history.replace(replace(self.document, material=live.material))
        self.autosave.soon(SAVED_SECONDS)
        self.improved.set()

    # Editing.

    def do(self, name: str, document: Document) -> None:
        """Go on to another document; a search that goes on begins anew with it."""
        document.require_sound(self.workspace.folder)
        self.break_off()
        self.history.do(name, self._with_materials_of_its_own(document))
        self._edited()

    def move(self, forwards: bool) -> None:
        """Redo or undo."""
        self.is_searching = False
        self.break_off()
        if not (self.history.redo() if forwards else self.history.undo()):
            raise UserError(f"there is nothing to {'redo' if forwards else 'undo'}")
        self._edited()

    def open(self, name: str, document: Document) -> None:
        """Begin with another project."""
        document.require_sound(self.workspace.folder)
        self.is_searching = False
        self.break_off()
        self.name, self.shows_fine = name, False
        self.search.forget()
        self.pages.tell_history()
        self.history.do(f"open {name}", document)
        self._edited()

    def _edited(self) -> None:
        news = self.solid.news
        if news is not None and news.phase in ("reading", "preparing"):
            if news.mesh != self.document.mesh:
                self.solid.end()
        self.changed_and_woken()

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

    # Searching.

    def begin_search(self) -> None:
        """Search from now on, as soon as the solid and the clips are ready."""
        if self.is_searching:
            return
        if not any(target.clip for target in self.document.targets):
            raise UserError("no target has a clip yet; place one and drop a clip on it")
        self.is_searching = True
        self.history.do("optimise", self.document)
        self.changed_and_woken()

    def stop_search(self) -> None:
        """End the search at once; what it has found stays, and is made a design."""
        self.is_searching = False
        self.is_finishing = self.search.phase != "idle"
        self.search.break_off()
        self.changed()

    def break_off(self) -> None:
        """End a search that goes on; its best material is that of the document by now."""
        self.message = self.live = None
        self.is_finishing = False
        if self.search.phase != "idle":
            self.search.break_off()

    def give_up_search(self, sentence: str) -> None:
        """Tell why there is no search, and want none any more."""
        if self.is_searching:
            self.is_searching, self.message = False, sentence
        self.changed()
        self.pages.say(sentence, "error")
