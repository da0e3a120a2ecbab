"""Pictures of the studio in all its states, on a desktop and on a telephone (test support).

    python -m tests.studio_pictures FOLDER    two minutes; also writes studio.webp, which moves

A real studio is opened with an example whose material is sought.
"""

import io
import sys
import tempfile
from pathlib import Path
from typing import Any

from PIL import Image

from tests.chromium import chromium
from tests.studio_load import real_studio, until

EXAMPLE = "e1"
WINDOWS: dict[str, dict[str, Any]] = {
    "wide": {"viewport": {"width": 1780, "height": 1040}},
    "desktop": {"viewport": {"width": 1280, "height": 800}},
    "dark": {"viewport": {"width": 1280, "height": 800}, "color_scheme": "dark"},
    "phone": {
        "viewport": {"width": 390, "height": 844},
        "has_touch": True,
        "is_mobile": True,
        "device_scale_factor": 2,
    },
}
FRAMES, FRAME_MILLISECONDS, WIDTH = 28, 350, 1068
TURN_PIXELS = 12
QUALITY = 60


class Windows:
    """Pages of one studio, which are in the same state."""

    def __init__(self, browser: Any, address: str, folder: Path) -> None:
        self._folder, self._count = folder, 0
        self.pages = {name: browser.new_context(**of).new_page() for name, of in WINDOWS.items()}
        for page in self.pages.values():
            page.goto(address)
            page.wait_for_url(lambda url: "token" not in url)
        self.until("window.studio?.state?.current")

    @property
    def first(self) -> Any:
        return self.pages["wide"]

    def until(self, expression: str) -> None:
        for page in self.pages.values():
            until(page, expression)

    def evaluate(self, script: str) -> None:
        for page in self.pages.values():
            page.evaluate(script)

    def press(self, key: str) -> None:
        for page in self.pages.values():
            page.keyboard.press(key)

    def take(self, state: str) -> None:
        """A picture of all that each page shows, scrolled through."""
        self._count += 1
        for name, page in self.pages.items():
            page.wait_for_timeout(300)
            path = self._folder / f"{self._count:02d}-{state}-{name}.png"
            page.screenshot(path=path, full_page=name == "phone")
        print(state, flush=True)

    def call(self, name: str, arguments: str = "{}") -> None:
        refused = "(error) => studio.say(error.message, 'error')"
        self.first.evaluate(f"studio.connection.call('{name}', {arguments}).catch({refused})")


def frame(page: Any) -> Image.Image:
    """The page as it is, smaller."""
    whole = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
    return whole.resize((WIDTH, WIDTH * whole.height // whole.width), Image.Resampling.LANCZOS)


def search_in_frames(page: Any) -> list[Image.Image]:
    """The search while the solid turns and is struck."""
    box = page.locator("#view canvas").first.bounding_box()
    corner = (box["x"] + 40, box["y"] + box["height"] - 60)
    frames = [frame(page)]
    page.evaluate("studio.connection.call('optimise')")
    for number in range(FRAMES):
        page.mouse.move(*corner)
        page.mouse.down()
        page.mouse.move(corner[0] + TURN_PIXELS, corner[1], steps=3)
        page.mouse.up()
        if number % 7 == 3:
            page.keyboard.press("Enter")
        page.wait_for_timeout(FRAME_MILLISECONDS)
        frames.append(frame(page))
    return frames


def main(folder: Path) -> None:
    """Write all pictures into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as work, chromium() as browser:
        with real_studio(work) as address:
            windows = Windows(browser, address, folder)
            windows.take("tour")
            windows.press("Escape")
            windows.take("empty")
            windows.call("open_mesh", "{ mesh: 'builtin:frying-pan' }")
            windows.take("preparing")
            windows.until("studio.view.settled")
            windows.take("solid")
            windows.call("add_target", "{ name: 'side', vertex: 0 }")
            windows.until("studio.state.current.targets.length === 1")
            windows.take("target")
            windows.call("optimise")
            windows.take("refused")
            windows.call("open_project", f"{{ project: '{EXAMPLE}' }}")
            windows.until("studio.state.current.wanted && studio.view.settled")
            windows.evaluate(
                "studio.selection.set({ target: studio.state.current.targets[0].name })"
            )
            windows.first.wait_for_timeout(2000)
            windows.take("example")
            frames = search_in_frames(windows.first)
            windows.take("searching")
            windows.call("stop")
            windows.until("studio.state.current.search.phase === 'idle'")
            windows.take("stopping")
            windows.until("studio.view.settled")
            windows.first.wait_for_timeout(3000)
            windows.take("found")
            windows.call("fine", "{ on: true }")
            windows.until("studio.state.current.fine.phase === 'ready'")
            windows.take("fine")
            windows.press("?")
            windows.take("keys")
            windows.press("Escape")
        windows.first.wait_for_timeout(2000)
        windows.take("alone")
    last = [FRAME_MILLISECONDS] * (len(frames) - 1) + [4 * FRAME_MILLISECONDS]
    frames[0].save(
        folder / "studio.webp",
        save_all=True,
        append_images=frames[1:],
        duration=last,
        loop=0,
        quality=QUALITY,
        method=6,
    )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
