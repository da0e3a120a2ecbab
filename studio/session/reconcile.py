"""Keeps solid, clips and search as the document describes them, and tells what it sounds like."""

from __future__ import annotations

import asyncio
import logging
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from carillon.errors import UserError
from studio.session.document import Document
from studio.session.searching import Live

if TYPE_CHECKING:
    from studio.session.studio import DesignStudio

BANK_SECONDS = 0.25
"""Time between two banks of a search."""
SAVED_SECONDS = 2.0
"""Time within which a material that a search has found is saved."""
FAULT = "this failed for a fault of the program; the terminal of the studio tells more"
logger = logging.getLogger(__name__)


class Upkeep:
    """What goes on behind a studio.

    Attributes
    ----------
    fine_phase
        Of the fine solid: `none`, `working` or `ready`.
    message
        Why there is no search, if there was to be one.
    """

    def __init__(self, studio: DesignStudio) -> None:
        self._studio = studio
        self._wake, self._lively = asyncio.Event(), asyncio.Event()
        self._tasks: list[asyncio.Future[None]] = []
        self._search_task: asyncio.Task[None] | None = None
        self._live: Live | None = None
        self._shown: Any = None
        self._is_finishing = False
        self._banks = 0
        self.fine_phase = "none"
        self.message: str | None = None

    def start(self) -> None:
        """Begin."""
        self._tasks = [asyncio.ensure_future(each) for each in (self._keep_up(), self._follow())]
        self._studio.bench.warm()
        self.wake()

    @property
    def _to_show(self) -> Any:
        """What a bank depends on."""
        studio = self._studio
        return (studio.document.material, studio.fine, studio.bench.aimed)

    @property
    def is_settled(self) -> bool:
        """Whether no search goes on, and pages know what the present material sounds like."""
        is_idle = self._studio.search.phase == "idle" and not self._is_finishing
        return is_idle and self._shown == self._to_show

    def wake(self) -> None:
        """Look at the document, which has changed."""
        self._wake.set()

    async def end(self) -> None:
        """End, and with it a search that goes on."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self.break_off()
        if self._search_task is not None:
            # It may be about to begin, and would go on for as long as it likes.
            self._search_task.cancel()
            await asyncio.gather(self._search_task, return_exceptions=True)

    def break_off(self) -> None:
        """End a search that goes on; its best material is that of the document by now."""
        self.message = self._live = None
        self._is_finishing = False
        if self._studio.search.phase != "idle":
            self._studio.search.break_off()

    def stop(self) -> None:
        """End a search that goes on, and make a design of what it has found."""
        self._is_finishing = self._studio.search.phase != "idle"
        self._studio.search.break_off()

    async def _keep_up(self) -> None:
        """Bring all that computes to what the document describes, again and again."""
        while True:
            await self._wake.wait()
            self._wake.clear()
            document = self._studio.document
            try:
                await self._bring(document)
            except UserError as error:
                if document is self._studio.document:
                    self._studio.pages.say(str(error), "error")
            except Exception:
                logger.exception("the studio could not keep up")
                self._studio.pages.say(FAULT, "error")

    async def _bring(self, document: Document) -> None:
        studio = self._studio
        heard = studio.clips.listen(document.targets)
        try:
            await studio.bench.bring(document, heard)
        except UserError as error:
            # Of the solid alone there is something to hear, even where the clips are no good.
            if document is studio.document and not studio.clips.are_listened_to:
                self._end_search(str(error))
            if not studio.bench.is_ready:
                return
        if document is not studio.document or heard != studio.clips.listen(document.targets):
            self.wake()
            return
        if studio.is_searching and not studio.clips.are_listened_to:
            self._start_search()
        if studio.search.phase == "idle":
            await self._show(document)
            studio.search.warm()

    async def _show(self, document: Document) -> None:
        """Tell the bank of the document's material, unless it is the last one that was told."""
        studio = self._studio
        # The design of a search that was stopped is soon there, and it alone has its frequencies.
        if not studio.bench.is_ready or self._is_finishing or self.is_settled:
            return
        material, fine, shown = document.material, studio.fine, self._to_show
        if fine:
            self.fine_phase = "working"
            studio.changed()
        name = "fine_bank" if fine else "bank"
        given: str | list[float] | None = None
        if material is not None and material.design is not None:
            name, given = f"{name}_of", material.design
        elif material is not None:
            given = list(material.z)
        try:
            message = await studio.bench.ask(name, given, self._header(fine))
        finally:
            self.fine_phase = "ready" if fine else "none"
        self._shown = shown
        studio.pages.tell_bank(message)
        studio.changed()

    def _header(self, fine: bool) -> dict[str, Any]:
        self._banks += 1
        surface = self._studio.bench.surface
        number = None if surface is None else surface[0]
        return {"number": self._banks, "surface": number, "fine": fine}

    def _start_search(self) -> None:
        if self._search_task is not None and not self._search_task.done():
            return
        if self._studio.bench.project is None:
            self._end_search("no clip could be listened to; see what its target says")
            return
        self._search_task = asyncio.ensure_future(self._search())

    async def _search(self) -> None:
        """One search, from the document's material until it ends or is broken off."""
        studio, document = self._studio, self._studio.document
        found = None
        try:
            problem = await studio.bench.ask("problem")
            if studio.is_searching and document is studio.document:
                out = studio.workspace.new_design()
                found = await studio.search.run(problem, document.material, out)
        except UserError as error:
            self._end_search(str(error))
        except Exception:
            logger.exception("the search failed")
            self._end_search(FAULT)
        else:
            if found is not None:
                studio.is_searching = False
                studio.history.replace(replace(studio.document, material=found))
            elif self._is_finishing:
                await self._finish()
        finally:
            self._is_finishing = False
            self._live = self._shown = None
            studio.pages.tell_history()
            studio.changed()
            self.wake()

    async def _finish(self) -> None:
        """Make the design of what a search has found that was stopped: it takes a moment longer."""
        studio, material = self._studio, self._studio.document.material
        studio.changed()
        if studio.is_searching or material is None or material.design is not None:
            return
        try:
            await studio.designed()
        except UserError as error:
            studio.pages.say(str(error), "error")

    def _end_search(self, sentence: str) -> None:
        """Tell why there is no search, and want none any more."""
        if self._studio.is_searching:
            self._studio.is_searching, self.message = False, sentence
        self._studio.changed()
        self._studio.pages.say(sentence, "error")

    def found(self, live: Live) -> None:
        """Take up a better material of a search."""
        self._live = live
        self._studio.history.replace(replace(self._studio.document, material=live.material))
        self._studio.autosave.soon(SAVED_SECONDS)
        self._lively.set()

    async def _follow(self) -> None:
        """Tell banks of a search that goes on: of its newest material, as often as may be."""
        while True:
            await self._lively.wait()
            self._lively.clear()
            live = self._live
            if live is None:
                continue
            with suppress(UserError):
                header = {**self._header(False), "cost": live.cost}
                z = list(live.material.z)
                message = await self._studio.bench.ask("bank", z, header, live.hertz)
                if self._live is not None:
                    self._studio.pages.tell_bank(message)
            await asyncio.sleep(BANK_SECONDS)
