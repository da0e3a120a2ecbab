"""Parts of pages that are made from the sources, in place of a line that says so, see `places`."""

import re
from collections.abc import Callable
from typing import Any

import command_help
import gallery
import notebooks
import rooms_picture
import schema_keys
from places import PLACE
from sphinx.application import Sphinx

PARTS: dict[str, Callable[..., str]] = {
    "commands": command_help.of_room,
    "rooms": rooms_picture.of_rooms,
    "packages": rooms_picture.of_packages,
    "configuration": schema_keys.of_configuration,
    "presets": schema_keys.of_presets,
    "project": schema_keys.of_project,
    "scene": schema_keys.of_scene,
    "examples": gallery.of_examples,
    "notebook": notebooks.of_notebook,
    "materials": schema_keys.of_materials,
}


def fill(app: Sphinx, page: str, source: list[str]) -> None:
    """Put the parts into the text of a page."""

    def part(place: re.Match[str]) -> str:
        name, *words = place[1].split()
        return PARTS[name](*words)

    source[0] = PLACE.sub(part, source[0])


def setup(app: Sphinx) -> dict[str, Any]:
    """Fill pages in as they are read."""
    app.connect("source-read", fill)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
