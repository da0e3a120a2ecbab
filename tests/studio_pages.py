"""The studio's page in a browser, on a studio that is made up (test support)."""

import importlib.util
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from tests.patience import PATIENCE_SECONDS
from tests.studio_server import served
from tests.studio_stub import StubStudio

TWO_FRAMES = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


class ToldStudio(StubStudio):
    """A made-up studio whose state a test may tell otherwise, and which may hold another solid."""

    soon: Callable[..., None]
    """Calls a function in the server's thread, and waits for that."""

    def __init__(self, mesh: trimesh.Trimesh | None = None) -> None:
        super().__init__()
        self.told: dict[str, Any] = {}
        self._first = dict(self._targets[0])
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


@contextmanager
def serving(studio: ToldStudio, port: int | None = None) -> Iterator[str]:
    """Address of the studio's page, with its token."""
    with served(studio=studio, port=port) as server:
        studio.soon = server.soon
        yield f"{server.origin}/?token={server.keys.token}"


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


def axe_finds(page: Any, impacts: Collection[str | None] = ("serious", "critical")) -> list[str]:
    """What axe finds wrong with a page as it is; skips the test where axe is not installed."""
    package = importlib.util.find_spec("axe_playwright_python")
    if package is None or package.origin is None:
        pytest.skip("axe-playwright-python is not installed")
    page.evaluate((Path(package.origin).parent / "axe.min.js").read_text(encoding="utf-8"))
    found = page.evaluate("axe.run(document, { resultTypes: ['violations'] })")["violations"]
    return [
        f"{each['id']}: {[node['html'] for node in each['nodes']]}"
        for each in found
        if each["impact"] in impacts
    ]


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
