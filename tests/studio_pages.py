"""The studio's page in a browser, on a studio that is made up (test support)."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import trimesh
import uvicorn

from studio.server.app import make_app
from studio.server.guard import Keys
from studio.server.serve import address_of, listen
from tests.patience import PATIENCE_SECONDS
from tests.studio_stub import StubStudio

TWO_FRAMES = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


class ToldStudio(StubStudio):
    """A made-up studio whose state a test may tell otherwise, and which may hold another solid."""

    def __init__(self, mesh: trimesh.Trimesh | None = None) -> None:
        super().__init__()
        self.told: dict[str, Any] = {}
        self._first = dict(self._targets[0])
        self.loop: asyncio.AbstractEventLoop | None = None
        if mesh is not None:
            self._mesh = mesh
            self._inward = -np.array(mesh.vertex_normals)
            self._targets[0]["position_m"] = mesh.vertices[self._targets[0]["vertex"]].tolist()

    def state(self) -> dict[str, Any]:
        return {**super().state(), **self.told}

    def tell(self, **told: Any) -> None:
        """Tell all pages another state."""
        self.told = told
        self.soon(self.changed)

    def anew(self) -> None:
        """The state that it began with."""
        self.told = {}
        self.calls.clear()
        self._targets[1:] = []
        self._targets[0].update(self._first)
        self._clips[1:] = []
        self.uploads.clear()
        self.soften(1.0)

    def soften(self, away: float) -> None:
        """Take up another material."""
        self._away = away
        self.soon(self.changed)

    def soon(self, function: Any) -> None:
        """Call a function in the server's thread, and wait for that."""
        assert self.loop is not None
        done = threading.Event()
        self.loop.call_soon_threadsafe(lambda: (function(), done.set()))
        assert done.wait(PATIENCE_SECONDS)


@contextmanager
def serving(studio: ToldStudio, port: int = 0) -> Iterator[str]:
    """Address of the studio's page, with its token."""
    listener, keys = listen("127.0.0.1", port), Keys()
    address = address_of(listener, "127.0.0.1")
    app = make_app(studio, keys, "127.0.0.1", listener.getsockname()[1])
    server = uvicorn.Server(
        uvicorn.Config(
            app,
            ws="websockets-sansio",
            lifespan="off",
            log_config=None,
            timeout_graceful_shutdown=1,
        )
    )

    async def run() -> None:
        studio.loop = asyncio.get_running_loop()
        await server.serve([listener])

    thread = threading.Thread(target=lambda: asyncio.run(run()), daemon=True)
    thread.start()
    try:
        until(lambda: server.started)
        yield f"{address}?token={keys.token}"
    finally:
        server.should_exit = True
        thread.join(PATIENCE_SECONDS)


def until(asked: Any, seconds: float = PATIENCE_SECONDS) -> Any:
    """What a function returns once that is neither None nor false."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if found := asked():
            return found
        time.sleep(0.03)
    raise AssertionError(f"not so within {seconds:g} s")


def until_page(page: Any, expression: str) -> Any:
    """The value of an expression in a page once it is true; pages allow no `wait_for_function`."""
    end = time.monotonic() + PATIENCE_SECONDS
    while time.monotonic() < end:
        if found := page.evaluate(expression):
            return found
        page.wait_for_timeout(40)
    raise AssertionError(f"never true: {expression}")


def until_still(page: Any) -> None:
    """Wait until what lies over the solid has its place, and nothing is drawn any more."""
    page.evaluate(TWO_FRAMES)
    until_page(page, "!studio.view.drawing?.waiting")


SPY = """() => {
  window.strikes = [];
  studio.bank.onStrike(({ vertex, strength }) => window.strikes.push([vertex, strength]));
}"""


def open_page(
    browser: Any, address: str, ready: str | None = None, script: str = "", **options: Any
) -> Any:
    """The page in a window of its own, once it is there; `window.strikes` are those of its bank.

    Parameters
    ----------
    ready
        Expression that is true then; without, that the solid and its material are drawn.
    script
        Run before those of the page.
    options
        Of the window, as the browser takes them.
    """
    context = browser.new_context(**{"viewport": {"width": 1280, "height": 800}, **options})
    page = context.new_page()
    page.faults = []
    page.on("pageerror", lambda error: page.faults.append(str(error)))
    # No tour, which would lie over the page.
    page.add_init_script("window.localStorage.setItem('carillon-studio-tour', 'seen');" + script)
    page.goto(address)
    page.wait_for_url(lambda url: "token" not in url)
    until_page(page, ready or "window.studio?.view?.settled")
    until_still(page)
    if page.evaluate("document.activeElement !== document.body"):
        page.keyboard.press("Escape")
    page.evaluate(SPY)
    return page
