"""A studio whose state is made up, for tests of its server and for work on its page.

`python -m tests.studio_stub [--port N]` serves the page with it.
"""

import argparse
import asyncio
import io
import math
import time
import wave
from collections.abc import Mapping
from typing import Any

import numpy as np
import trimesh

from carillon.errors import UserError
from carillon.fem.geometry import builtin_surface
from carillon.parameters.documents import with_defaults
from sound.project.project import Project
from studio.binary import pack
from studio.feed import Feed
from studio.interface import Download, NotFoundError
from studio.session.handlers import require_call
from studio.session.snapshot import ELSEWHERE

STEP_SECONDS = 0.2
"""Between two improvements of the made-up search."""
WANTED = 523.25 * np.array([1.0, 1.5, 2.0, 2.4, 3.0, 4.0, 5.2, 6.7])
"""Frequencies of the clip [Hz]."""


def clip_entry(
    identifier: str, name: str, hertz: np.ndarray, dampings: np.ndarray
) -> dict[str, Any]:
    """A clip as the page is told of it, each of whose modes is fainter than that before."""
    modes = [
        {"hertz": each, "damping_per_second": damping, "amplitude": 0.5 / (k + 1)}
        for k, (each, damping) in enumerate(zip(hertz.tolist(), dampings.tolist()))
    ]
    return {
        "clip": identifier,
        "name": name,
        "phase": "ready",
        "message": None,
        "seconds": 1.2,
        "rate_hz": 44100,
        "progress": None,
        "explained": 0.9563,
        "says": ["its first 12 ms are left out"],
        "modes": modes,
    }


def target_entry(name: str, vertex: int, clip: str | None, position: list[float]) -> dict[str, Any]:
    place = {"name": name, "vertex": vertex, "position_m": position}
    return {**place, "clip": clip, "modes": None, "allow_clipped": False, "without": []}


def solid_entry(surface: int, mesh: trimesh.Trimesh) -> dict[str, Any]:
    """A bell that is ready, whatever its mesh is."""
    return {
        "mesh": "builtin:bell",
        "name": "bell",
        "phase": "ready",
        "progress": None,
        "message": None,
        "surface": surface,
        "vertices": len(mesh.vertices),
        "triangles": len(mesh.faces),
        "voxels": 11085,
        "unknowns": 5619,
        "longest_side_m": float(mesh.extents.max()),
        "extents_m": mesh.extents.tolist(),
        "units": [],
        "up": None,
        "shell_m": None,
    }


def heads_entry(**changes: Any) -> dict[str, Any]:
    """No measured heads, as the page is told of them; or others."""
    none = dict.fromkeys(("folder", "message", "progress", "heads", "comparisons", "direction"))
    return {"folders": [], **none, "phase": "none", "file": None, "blend": None, **changes}


def state_entry(settings: Mapping[str, Any], **changes: Any) -> dict[str, Any]:
    """A state of a studio in which nothing is going on."""
    return {
        "event": "state",
        "revision": 1,
        "saved": True,
        "workspace": "stub",
        "undo": None,
        "redo": None,
        "settings": {k: v for k, v in settings.items() if k not in ELSEWHERE},
        "composition": None,
        "regions": [],
        "supports": [],
        "search": {"phase": "idle", "message": None},
        "fine": {"on": False, "phase": "none", "message": None},
        "heard": None,
        "heads": heads_entry(),
        "builtins": ["bell", "frying-pan"],
        "examples": [{"project": "e1", "name": "recorded-bell", "says": "made up"}],
        "projects": [{"project": "p1", "name": "pan"}],
        **changes,
    }


class StubStudio:
    """A bell with a target and a bank of eight modes, which a search brings to their targets."""

    def __init__(self) -> None:
        mesh = builtin_surface("bell")
        self._mesh = mesh
        self._inward = -np.array(mesh.vertex_normals)
        self.feeds: set[Feed] = set()
        self._revision = self._bank = 0
        self._away = 1.0
        self._search: asyncio.Task[None] | None = None
        self._history: list[dict[str, float]] = []
        self._targets: list[dict[str, Any]] = []
        self._clips = [self._clip("c1", "bell.wav")]
        self._settings = with_defaults({}, Project)
        self._phase = "idle"
        self._heard: str | None = None
        self.uploads: list[tuple[str, str, int]] = []
        self.calls: list[tuple[str, dict[str, Any]]] = []
        self.closed = False
        self._add(int(np.argmin(mesh.vertices[:, 2])), "rim", "c1")

    async def start(self) -> None:
        pass

    def _clip(self, identifier: str, name: str) -> dict[str, Any]:
        return clip_entry(identifier, name, WANTED, 3.0 + np.arange(len(WANTED)))

    def _add(self, vertex: int, name: str, clip: str | None) -> None:
        self._targets.append(target_entry(name, vertex, clip, self._mesh.vertices[vertex].tolist()))

    def state(self) -> dict[str, Any]:
        clips = [each for each in self._targets if each["clip"] is not None]
        wanted = {
            "hertz": WANTED.tolist(),
            "dampings_per_second": (3.0 + np.arange(len(WANTED))).tolist(),
            "amplitudes": [(0.5 / (1 + np.arange(len(WANTED)))).tolist() for _ in clips],
        }
        return state_entry(
            revision=self._revision,
            name="stub",
            solid=solid_entry(1, self._mesh),
            targets=self._targets,
            clips=self._clips,
            wanted=wanted if clips else None,
            settings=self._settings,
            search={"phase": self._phase, "message": None},
            heard=self._heard,
        )

    def bank(self) -> bytes:
        """The bank of the present material."""
        points = np.array(self._mesh.vertices) / self._mesh.extents.max()
        k = np.arange(len(WANTED))
        hertz = WANTED * (1.0 + 0.2 * self._away * np.sin(1.0 + k))
        angle = np.arctan2(points[:, 1], points[:, 0])
        gains = np.cos(angle[:, None] * (1 + k // 2)) * np.cos(points[:, 2:] * (1 + k)) / (1 + k)
        young = 1e9 * 10.0 ** (self._away * np.sin(9.0 * points[:, 0]) * np.cos(7.0 * points[:, 2]))
        cents = 1200.0 * np.log2(hertz / WANTED)
        header = {
            "event": "bank",
            "number": self._bank,
            "surface": 1,
            "fine": False,
            "cost": self._away**2,
            "checked": False,
            "rigid_motions": 6,
            "rms_cents": float(np.sqrt(np.mean(cents**2))),
            "targets": [each["name"] for each in self._targets],
            "wanted_hertz": WANTED.tolist(),
            "cents": cents.tolist(),
            "bark": (cents / 150.0).tolist(),
        }
        arrays = {
            "hertz": ("f8", hertz),
            "dampings": ("f8", 3.0 + k),
            "gains": ("f4", 0.5 * gains / np.abs(gains).sum(axis=1).max()),
            "young": ("f4", young),
            "struck": ("f8", 0.1 * gains[[each["vertex"] for each in self._targets]]),
        }
        return pack(header, arrays)

    def subscribe(self) -> Feed:
        feed = Feed()
        feed.send(self.state(), newest="state")
        feed.send({"event": "history", "rows": self._history, "checks": []}, newest="history")
        feed.put(self.bank(), newest="bank")
        self.feeds.add(feed)
        return feed

    def unsubscribe(self, feed: Feed) -> None:
        self.feeds.discard(feed)

    def changed(self, bank: bool = True) -> None:
        """Tell all pages."""
        self._revision += 1
        self._bank += bank
        for feed in self.feeds:
            feed.send(self.state(), newest="state")
            if bank:
                feed.put(self.bank(), newest="bank")

    async def call(self, name: str, arguments: Mapping[str, Any]) -> None:
        require_call(name, arguments)
        self.calls.append((name, dict(arguments)))
        if name == "add_target":
            vertex = arguments["vertex"]
            if not isinstance(vertex, int) or not 0 <= vertex < len(self._mesh.vertices):
                raise UserError(f"vertex {vertex!r:.40}: expected one of the solid's")
            default = f"target {len(self._targets) + 1}"
            self._add(vertex, str(arguments.get("name") or default), arguments.get("clip"))
        elif name in ("change_target", "remove_target"):
            target = self._target(arguments["target"])
            if name == "remove_target":
                self._targets.remove(target)
            target.update({k: v for k, v in arguments.items() if k != "target"})
            target["position_m"] = self._mesh.vertices[target["vertex"]].tolist()
        elif name == "change_settings":
            self._settings.update(arguments["settings"])
        elif name == "open_mesh" and not str(arguments["mesh"]).startswith("builtin:"):
            raise UserError(f"{arguments['mesh']}: this stub has the bell alone")
        elif name == "optimise" and self._search is None:
            self._search = asyncio.create_task(self._searching())
        elif name == "stop" and self._search is not None:
            self._search.cancel()
            self._search, self._phase = None, "idle"
        elif name == "forget_material":
            self._away, self._history = 1.0, []
        elif name == "keep":
            self._heard = "B"
        self.changed()

    def _target(self, name: object) -> dict[str, Any]:
        for target in self._targets:
            if target["name"] == name:
                return target
        raise UserError(f"there is no target {name!r:.100}")

    async def _searching(self) -> None:
        self._phase = "running"
        begin = time.monotonic()
        while self._away > 1e-3:
            await asyncio.sleep(STEP_SECONDS)
            self._away *= 0.97
            row = {
                "seconds": time.monotonic() - begin,
                "evaluations": 4 * (len(self._history) + 1),
                "cost": self._away**2,
                "frequency_cost": 0.7 * self._away**2,
                "amplitude_cost": 0.2 * self._away**2,
                "regulariser": 0.1 * self._away**2,
            }
            self._history.append(row)
            for feed in self.feeds:
                feed.send({"event": "progress", **row, "checks": []}, newest="progress")
            self.changed()
        self._search, self._phase = None, "idle"
        self.changed()

    async def take_mesh(self, name: str, content: bytes) -> str:
        if content.startswith(b"broken"):
            raise UserError(
                f"{name}: is not readable as a mesh (made up); expected STL, OBJ or PLY"
            )
        self.uploads.append(("mesh", name, len(content)))
        return f"m{len(self.uploads)}"

    async def take_clip(self, name: str, content: bytes) -> str:
        if not content.startswith(b"RIFF"):
            raise UserError(f"{name}: is not readable as sound; expected WAV")
        self.uploads.append(("clip", name, len(content)))
        clip = self._clip(f"c{len(self._clips) + 1}", name)
        self._clips.append(clip)
        self.changed(bank=False)
        return str(clip["clip"])

    async def surface(self, number: int) -> bytes:
        if number != 1:
            raise NotFoundError(f"there is no surface {number} any more")
        header = {"event": "surface", "number": 1, "unit": 1.0}
        arrays = {
            "positions": ("f4", self._mesh.vertices),
            "inward": ("f4", self._inward),
            "triangles": ("u4", self._mesh.faces),
        }
        return pack(header, arrays)

    async def composition(self, number: int) -> bytes:
        raise NotFoundError(f"there is no composition {number} any more")

    def _require_clip(self, clip: str) -> None:
        if clip not in [each["clip"] for each in self._clips]:
            raise NotFoundError(f"there is no clip {clip!r:.100}")

    async def clip_sound(self, clip: str, part: str) -> bytes:
        self._require_clip(clip)
        return wav_of(0.3 if part in ("sound", "modes") else 0.02)

    async def clip_spectrum(self, clip: str) -> dict[str, list[float]]:
        self._require_clip(clip)
        hertz = np.geomspace(50.0, 12_000.0, 600)
        level = sum(0.5**k * np.exp(-((hertz / f - 1.0) ** 2) / 1e-4) for k, f in enumerate(WANTED))
        decibels = 20.0 * np.log10(level + 1e-4)
        return {"hertz": hertz.tolist(), "decibels": (decibels - decibels.max()).tolist()}

    async def head_sound(self, number: int, part: str, stimulus: str) -> bytes:
        if number != 0:
            raise UserError(f"comparison {number} is not the present one, 0")
        return wav_of(0.3)

    async def export(self, kind: str, target: str | None) -> Download:
        if kind == "wav":
            self._target(target)
            return Download(f"{target}.wav", "audio/wav", wav_of(0.3))
        return Download(f"stub.{kind}", "application/octet-stream", kind.encode())

    async def close(self) -> None:
        self.closed = True
        if self._search is not None:
            self._search.cancel()


def wav_of(loudness: float, rate: int = 44_100) -> bytes:
    """A struck bell of the wanted modes, or something softer, as WAV."""
    t = np.arange(rate) / rate
    tones = [
        np.exp(-(3.0 + k) * t) * np.sin(2.0 * math.pi * f * t) / (k + 1)
        for k, f in enumerate(WANTED)
    ]
    samples = (32767 * loudness * sum(tones) / len(tones)).astype("<i2")
    content = io.BytesIO()
    with wave.open(content, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(rate)
        file.writeframes(samples.tobytes())
    return content.getvalue()


def main() -> None:
    """Serve the page."""
    from studio.server.guard import Keys
    from studio.server.serve import address_of, listen, serve

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int)
    listener = listen("127.0.0.1", parser.parse_args().port)
    keys = Keys()
    print(f"{address_of(listener, '127.0.0.1')}?token={keys.token}", flush=True)
    serve(StubStudio(), listener, "127.0.0.1", keys)


if __name__ == "__main__":
    main()
