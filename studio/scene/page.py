"""Writes the page of a scene: one file that opens in any browser, without server or network."""

from __future__ import annotations

from pathlib import Path

from carillon.command_line.progress import say
from carillon.files.atomic import atomic_path
from sound.scenes.performance import Performance
from studio.scene.content import content
from studio.standalone.modules import PAGE
from studio.standalone.page import assembled

HERE = Path(__file__).resolve().parent
STYLES = (PAGE / "studio.css", PAGE / "solid.css", HERE / "scene.css")
PROCESSOR = HERE / "processor.js"
LARGE_BYTES = 25_000_000
"""Size of a page in bytes above which it is named."""


def write_scene_page(path: str | Path, performance: Performance) -> None:
    """Write a scene as one page: played, turned, and struck anywhere.

    A line of progress says how large the file is where it is larger than `LARGE_BYTES`.

    Raises
    ------
    UserError
        If the file cannot be written, or parts of the performance do not fit each other.
    """
    text = page_of(performance)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    if len(text) > LARGE_BYTES:
        triangles = sum(len(each.faces) for each in performance.picture.objects)
        modes = sum(0 if each is None else len(each.frequencies) for each in performance.voices)
        seconds = len(performance.sound) / performance.rate
        say(
            f"{path}: {len(text) / 1e6:.0f} MB for {triangles:,} triangles, {modes:,} modes and "
            f"{seconds:.0f} s of sound; coarser meshes and fewer modes would make it smaller"
        )


def page_of(performance: Performance) -> str:
    """The page as text."""
    return assembled(HERE, PROCESSOR, STYLES, performance.title, content(performance))
