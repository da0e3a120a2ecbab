"""A browser and a server of files for tests of pages (test support)."""

import functools
import http.server
import shutil
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from tests.patience import PATIENCE_SECONDS
from tests.programs import CHECKOUT

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
ARGUMENTS = (
    "--no-sandbox",
    "--enable-unsafe-swiftshader",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--autoplay-policy=no-user-gesture-required",
    "--use-fake-device-for-media-stream",
    "--use-fake-ui-for-media-stream",
)
BLANK = b"<!doctype html><html lang=en><title>test</title><link rel=icon href=data:,><body></body>"


@contextmanager
def chromium(*arguments: str) -> Iterator[Any]:
    """A browser of playwright's; skips the test where there is none."""
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    program = next(filter(None, map(shutil.which, PROGRAMS)), None)
    if program is None:
        pytest.skip(f"no browser is installed, expected one of {', '.join(PROGRAMS)}")
    api.expect.set_options(timeout=1000.0 * PATIENCE_SECONDS)
    with api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=program, args=[*ARGUMENTS, *arguments])
        for name in ("new_page", "new_context"):
            setattr(browser, name, _patient(getattr(browser, name)))
        try:
            yield browser
        finally:
            browser.close()


def _patient(make: Callable[..., Any]) -> Callable[..., Any]:
    """What makes a page or a context whose actions may take as long as on a busy machine."""

    @functools.wraps(make)
    def made(*arguments: Any, **options: Any) -> Any:
        found = make(*arguments, **options)
        found.set_default_timeout(1000.0 * PATIENCE_SECONDS)
        return found

    return made


class _Files(http.server.SimpleHTTPRequestHandler):
    """The studio's files below /page/, an empty page at /, else files of a folder."""

    more: Path

    def do_GET(self) -> None:
        if self.path == "/":
            self.send_response(200)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.end_headers()
            self.wfile.write(BLANK)
        else:
            super().do_GET()

    def translate_path(self, path: str) -> str:
        name = path.split("?")[0].lstrip("/")
        if name.startswith("page/"):
            return str(CHECKOUT / "studio" / name)
        return str(self.more / name)

    def log_message(self, *_: Any) -> None:
        pass


@contextmanager
def served(more: Path) -> Iterator[str]:
    """Address of a server of the page's modules, and of files of a folder."""
    handler = type("Files", (_Files,), {"more": more})
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(handler))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        server.server_close()
