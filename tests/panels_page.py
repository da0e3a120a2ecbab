"""The studio's page without a server: playwright answers its requests (test support)."""

import copy
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np
import trimesh

from carillon.parameters.documents import with_defaults
from carillon.parameters.schema import schema_of
from sound.project.project import Project
from studio.binary import pack
from studio.materials import material_table
from studio.server.page_files import page_policy
from tests.studio_stub import clip_entry, solid_entry, state_entry, target_entry

PAGE = Path(__file__).resolve().parent.parent / "studio" / "page"
ADDRESS = "http://localhost/"
TOUR_SEEN = "localStorage.setItem('carillon-studio-tour', 'seen')"
TYPES = {
    ".html": "text/html",
    ".js": "text/javascript",
    ".css": "text/css",
    ".svg": "image/svg+xml",
}
WANTED = np.array([440.0, 660.0, 990.0, 1500.0])
"""Frequencies of the clip [Hz]."""
NOW = WANTED * 2.0 ** (np.array([0.0, 30.0, -80.0, 3.0]) / 1200.0)

SILENT = {
    "sound/bank.js": """
        export function makeBank() {
          const bank = { failure: null, volume: 1, solo: (k) => note("solo", k), onStrike() {},
            strike: (vertex, strength) => note("strike", vertex, strength) };
          window.heard = [];
          return bank;
        }
        function note(...what) { window.heard.push(what); return true; }""",
    "sound/player.js": """
        export function makePlayer() {
          const play = async (piece) => {
            if (typeof piece === "function") piece();
            else window.heard.push(["play", typeof piece === "string" ? piece : piece.duration]);
            return true;
          };
          return { play, onChange() {}, stop: () => window.heard.push(["stop"]),
            playInTurn: async (pieces) => { for (const piece of pieces) await play(piece); } };
        }""",
    "sound/recorder.js": """
        export function makeRecorder() {
          let full = () => {};
          const blob = () => new Blob(["RIFF"]);
          return { seconds: 2.5, longestSeconds: 10, level: () => 0.5, start: async () => {},
            stop: async () => blob(), cancel: () => window.heard.push(["cancel"]),
            onFull: (listener) => { full = listener; }, fill: () => full(blob()) };
        }""",
    "sound/noise.js": "export function makeNoise() { return { on: false }; }",
    "solid/solid.js": """
        export function makeSolid() {
          return { openChooser: () => window.heard.push(["chooser"]) };
        }
    """,
}
"""Modules in place of those that sound and draw: they note in `window.heard` what is asked."""


def ready_clip() -> dict[str, Any]:
    return clip_entry("c1", "plate.wav", WANTED, np.full(4, 8.0))


def target(name: str, vertex: int, clip: str | None) -> dict[str, Any]:
    return target_entry(name, vertex, clip, [0.0, 0.0, 0.0])


def state(**changes: Any) -> dict[str, Any]:
    """A state of two targets, the first one of which has a clip with four modes."""
    wanted = {
        "hertz": WANTED.tolist(),
        "dampings_per_second": [8.0] * 4,
        "amplitudes": [[0.5, 0.25, 0.1, 0.05], [0.1, 0.1, 0.1, 0.1]],
    }
    triangle = trimesh.Trimesh(0.1 * np.eye(3), [[0, 1, 2]])
    made = state_entry(
        with_defaults({}, Project),
        name="pan",
        solid=solid_entry(3, triangle),
        targets=[target("rim", 1, "c1"), target("handle", 2, None)],
        clips=[ready_clip()],
        wanted=wanted,
    )
    return copy.deepcopy(made) | changes


def bank(
    hertz: np.ndarray = NOW,
    number: int = 1,
    wanted: bool = True,
    rigid_motions: int = 6,
    cost: float = 0.4,
    checked: bool = False,
    **more: Any,
) -> bytes:
    """The bank of a triangle whose modes are a little off."""
    told = {
        "wanted_hertz": WANTED.tolist(),
        "cents": (1200 * np.log2(hertz / WANTED)).tolist(),
        "bark": ((hertz - WANTED) / 100).tolist(),
    }
    gains = np.outer([1.0, 0.8, 0.6], [0.5, 0.25, 0.2, 0.01])
    header = {
        "event": "bank",
        "number": number,
        "surface": 3,
        "fine": False,
        "cost": cost,
        "checked": checked,
        "rigid_motions": rigid_motions,
        "rms_cents": float(np.sqrt(np.mean((1200 * np.log2(hertz / WANTED)) ** 2))),
        "targets": ["rim", "handle"],
        **(told if wanted else dict.fromkeys(told)),
        **more,
    }
    arrays = {
        "hertz": ("f8", hertz),
        "dampings": ("f8", np.full(4, 8.0)),
        "gains": ("f4", gains),
        "young": ("f4", np.full(3, 1e9)),
        "struck": ("f8", gains[1:]),
    }
    return pack(header, arrays)


def progress(seconds: float, cost: float, *checks: dict[str, float]) -> dict[str, Any]:
    return {
        "checks": list(checks),
        "event": "progress",
        "seconds": seconds,
        "evaluations": int(10 * seconds) + 1,
        "cost": cost,
        "frequency_cost": 0.7 * cost,
        "amplitude_cost": 0.2 * cost,
        "regulariser": 0.1 * cost,
    }


class Panels:
    """The page, what it asked for, and what it is told.

    Attributes
    ----------
    calls
        Names and arguments of the page's calls, in order.
    uploads
        Paths of what it has sent.
    refused
        Sentences by the names of calls that are refused.
    faults
        What the browser complained of.
    """

    def __init__(self, page: Any) -> None:
        self.page = page
        self._forget(state())
        page.on("pageerror", lambda error: self.faults.append(str(error)))
        page.on("console", self._hear)
        page.route("**/*", self._answer)
        page.route_web_socket("**/socket", self._connect)

    def _forget(self, first: Mapping[str, Any]) -> None:
        self.state = dict(first)
        self.calls: list[tuple[str, dict[str, Any]]] = []
        self.uploads: list[str] = []
        self.refused: dict[str, str] = {}
        self.faults: list[str] = []
        self._socket: Any = None

    def _hear(self, message: Any) -> None:
        # Tests read pixels, of which the browser says that it is slow.
        if message.type in ("error", "warning") and not message.text.startswith("Canvas2D"):
            self.faults.append(message.text)

    def open(self, first: Mapping[str, Any] | None = None) -> None:
        """Load the page anew, and tell it a state."""
        self._forget(state() if first is None else first)
        self.page.goto(ADDRESS)
        self.page.wait_for_selector("#panel-compare button")
        self.page.wait_for_selector("#panel-settings select", state="attached")

    def tell(self, event: Mapping[str, Any] | bytes) -> None:
        """Send an event to the page."""
        self._socket.send(event if isinstance(event, bytes) else json.dumps(event))

    def change(self, **changes: Any) -> None:
        """Send a state that differs in some keys."""
        self.state |= changes | {"revision": self.state["revision"] + 1}
        self.tell(self.state)

    def heard(self) -> list[Any]:
        """What was asked of the sound, since last asked."""
        found: list[Any] = self.page.evaluate("window.heard.splice(0)")
        return found

    def _connect(self, socket: Any) -> None:
        self._socket = socket
        socket.on_message(self._reply)
        self.tell(self.state)
        self.tell({"event": "history", "rows": [], "checks": []})
        if self.state["solid"]:
            self.tell(bank())

    def _reply(self, text: str) -> None:
        message = json.loads(text)
        name, number = message.pop("do"), message.pop("id")
        self.calls.append((name, message))
        refusal = {"error": self.refused[name]} if name in self.refused else {}
        self.tell({"reply": number, **refusal})

    def _answer(self, route: Any) -> None:
        url = urlsplit(route.request.url)
        path = url.path
        if path == "/":
            content = (PAGE / "index.html").read_bytes()
            policy = {"Content-Security-Policy": page_policy(content)}
            route.fulfill(body=content, headers={"Content-Type": "text/html"} | policy)
        elif path.startswith("/page/"):
            name = path.removeprefix("/page/")
            content = SILENT.get(name) or (PAGE / name).read_bytes()
            route.fulfill(body=content, headers={"Content-Type": TYPES[Path(name).suffix]})
        elif path == "/schema.json":
            route.fulfill(json=schema_of(Project))
        elif path == "/materials.json":
            route.fulfill(json=material_table())
        elif path == "/clip":
            self.uploads.append(parse_qs(url.query)["name"][0])
            route.fulfill(json={"clip": f"c{9 + len(self.uploads)}"})
        elif path.endswith("/spectrum"):
            hertz = np.geomspace(50.0, 5000.0, 400)
            near = np.min(np.abs(np.log2(hertz[:, None] / WANTED)), axis=1)
            route.fulfill(json={"hertz": hertz.tolist(), "decibels": (-90 * near).tolist()})
        elif path == "/export/h5":
            named = {"Content-Disposition": "attachment; filename*=UTF-8''pan%20design.h5"}
            route.fulfill(body=b"design", headers=named)
        elif path.startswith("/export/"):
            route.fulfill(status=400, json={"error": "There is no design yet; optimise first."})
        else:
            route.fulfill(status=404, json={"error": f"there is no {path}"})


@contextmanager
def window(
    browser: Any, width: int = 1280, height: int = 900, scheme: str = "light", tour: bool = False
) -> Iterator[Panels]:
    """A window for the page, which is not open yet; with `tour` it has not been here before."""
    context = browser.new_context(
        viewport={"width": width, "height": height}, color_scheme=scheme, reduced_motion="reduce"
    )
    page = context.new_page()
    if not tour:
        page.add_init_script(TOUR_SEEN)
    try:
        yield Panels(page)
    finally:
        context.close()
