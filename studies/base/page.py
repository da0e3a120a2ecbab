"""HTML pages that carry their figures, tables and style within themselves."""

from __future__ import annotations

import base64
from pathlib import Path
from typing import Any

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from studies.base.colours import themed
from studies.base.conditions import LABELS
from studies.base.numbers import show

HERE = Path(__file__).parent
ROOT = HERE.parent.parent

FIRST_MODES = 12
"""Elastic modes listed from the first on; beyond them `HIGHER_MODES`."""
HIGHER_MODES = (24, 32, 48, 64, 96, 128, 192, 256)


def rendered(template: str, **values: Any) -> str:
    """A page by its template, as seen from the folder that holds all packages."""
    environment = Environment(
        loader=FileSystemLoader(ROOT),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["show"] = unbroken
    environment.globals["condition_labels"] = LABELS
    environment.globals["style"] = Markup((HERE / "page.css").read_text())
    return environment.get_template(template).render(**values)


def inline(path: Path) -> Markup:
    """An SVG file as part of a page, in the page's own colours and font."""
    return Markup(themed(path.read_text(encoding="utf-8")))


def unbroken(value: Any, kind: str = "text") -> str:
    """The number as `show` writes it, with a space before its unit at which no line breaks."""
    text = show(value, kind)
    return text if kind == "text" else text.replace(" ", "\N{NO-BREAK SPACE}")


def listed_modes(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Of rows with a `mode` from the first elastic one on, those that a page lists."""
    higher = [row for row in rows[FIRST_MODES:] if row["mode"] in HIGHER_MODES]
    return rows[:FIRST_MODES] + higher


def picture_uri(path: Path) -> str:
    """A PNG file as a data URI."""
    return data_uri("image/png", path.read_bytes())


def data_uri(kind: str, content: bytes) -> str:
    """Content of a file as a data URI."""
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"
