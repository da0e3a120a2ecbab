"""Brings solid, clips and search to what the document describes, and tells what it sounds like."""

import asyncio
import logging
from contextlib import suppress
from dataclasses import replace
from typing import Any

from carillon.errors import UserError
from studio.session.document import Document
from studio.session.projects import designed
from studio.session.state import StudioState

BANK_SECONDS = 0.25
"""Time between two banks of a search."""
FAULT = "this failed for a fault of the program; the terminal of the studio tells more"
"""Sentence for pages where an error is not the person's."""
logger = logging.getLogger(__name__)


class Reconciler:
    """Tasks behind a studio that follow its state."""

    def __init__(self, state: StudioState) -> None:
        self._state = state
        self._tasks: list[asyncio.Future[None]] = []
        self._search_task: asyncio.Task[None] | None = None
        self._shown: Any = None
        self._banks = 0

    def start(self) -> None:
        """Begin."""
        tasks = (self._keep_up(), self._place(), self._follow())
        self._tasks = [asyncio.ensure_future(each) for each in tasks]
        self._state.solid.warm()
        self._state.woken.set()
        self._state.placed.set()

    @property
    def _to_show(self) -> Any:
        state = self._state
        return (state.document.material, state.shows_fine, state.solid.aimed)

    @property
    def is_settled(self) -> bool:
        """Whether no search goes on, and pages know what the present material sounds like."""
        is_idle = self._state.search.phase == "idle" and not self._state.is_finishing
        return is_idle and self._shown == self._to_show

    async def end(self) -> None:
        """End, and with it a search that goes on."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._state.break_off()
        if self._search_task is not None:
            # It may be about to begin, and would go on for as long as it likes.
            self._search_task.cancel()
            await asyncio.gather(self._search_task, return_exceptions=True)

    async def _keep_up(self) -> None:
        while True:
            await self._state.woken.wait()
            self._state.woken.clear()
            document = self._state.document
            try:
                await self._bring(document)
            except UserError as error:
                if document is self._state.document:
                    self._state.pages.say(str(error), "error")
            except Exception:
                logger.exception("the studio could not keep up")
                self._state.pages.say(FAULT, "error")

    async def _place(self) -> None:
        """Tell where regions and supports are, while the solid may still be prepared."""
        while True:
            await self._state.placed.wait()
            self._state.placed.clear()
            try:
                await self._state.placing.bring(self._state.document)
            except UserError as error:
                logger.info("rows could not be placed: %s", error)  # the solid tells it

    async def _bring(self, document: Document) -> None:
        state = self._state
        heard = state.clips.listen(document.targets)
        try:
            await state.solid.bring(document, heard)
        except UserError as error:
            # Of the solid alone there is something to hear, even where the clips are no good.
            if document is state.document and not state.clips.are_listened_to:
                state.give_up_search(str(error))
            if not state.solid.is_ready:
                return
        if document is not state.document or heard != state.clips.listen(document.targets):
            state.woken.set()
            return
        if state.is_searching and not state.clips.are_listened_to:
            self._start_search()
        if state.search.phase == "idle":
            await self._show(document)
            state.search.warm()

    async def _show(self, document: Document) -> None:
        """Tell the bank of the document's material, unless it is the last one that was told."""
        state = self._state
        # The design of a search that was stopped is soon there, and it alone has its frequencies.
        if not state.solid.is_ready or state.is_finishing or self.is_settled:
            return
        material, fine, shown = document.material, state.shows_fine, self._to_show
        if fine:
            state.fine_phase = "working"
            state.changed()
        name = "fine_bank" if fine else "bank"
        given: str | list[float] | None = None
        if material is not None and material.design is not None:
            name, given = f"{name}_of", material.design
        elif material is not None:
            given = list(material.z)
        try:
            message = await state.solid.ask(name, given, self._header(fine))
        finally:
            state.fine_phase = "ready" if fine else "none"
        self._shown = shown
        state.pages.tell_bank(message)
        state.changed()

    def _header(self, fine: bool) -> dict[str, Any]:
        self._banks += 1
        surface = self._state.solid.surface
        number = None if surface is None else surface[0]
        return {"number": self._banks, "surface": number, "fine": fine}

    def _start_search(self) -> None:
        if self._search_task is not None and not self._search_task.done():
            return
        if self._state.solid.project is None:
            self._state.give_up_search("no clip could be listened to; see what its target says")
            return
        self._search_task = asyncio.ensure_future(self._search())

    async def _search(self) -> None:
        state, document = self._state, self._state.document
        result = None
        try:
            problem = await state.solid.ask("problem")
            if state.is_searching and document is state.document:
                out = state.workspace.new_design()
                result = await state.search.run(problem, document.material, out)
        except UserError as error:
            state.give_up_search(str(error))
        except Exception:
            logger.exception("the search failed")
            state.give_up_search(FAULT)
        else:
            if result is not None:
                state.is_searching = False
                state.history.replace(replace(state.document, material=result))
            elif state.is_finishing:
                await self._finish()
        finally:
            state.is_finishing = False
            self._state.live = self._shown = None
            state.pages.tell_history()
            state.changed()
            state.woken.set()

    async def _finish(self) -> None:
        state, material = self._state, self._state.document.material
        state.changed()
        if state.is_searching or material is None or material.design is not None:
            return
        try:
            await designed(state)
        except UserError as error:
            state.pages.say(str(error), "error")

    async def _follow(self) -> None:
        """Tell banks of a search that goes on: of its newest material, as often as may be."""
        while True:
            await self._state.improved.wait()
            self._state.improved.clear()
            live = self._state.live
            if live is None:
                continue
            with suppress(UserError):
                header = {**self._header(False), "cost": live.cost}
                z = list(live.material.z)
                message = await self._state.solid.ask("bank", z, header, live.hertz)
                if self._state.live is not None:
                    self._state.pages.tell_bank(message)
            await asyncio.sleep(BANK_SECONDS)
