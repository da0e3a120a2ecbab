"""HTML pages that carry their figures, tables and style within themselves, as values of Python.

A study's function `page(results, tables)` returns a `StudyPage`, whose sections consist of the
parts in `studies.base.parts`. All pages have the one template beside this file.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from jinja2 import Environment, StrictUndefined, Template
from markupsafe import Markup

from studies.base.parts import html, machine, together
from studies.base.table import Table

HERE = Path(__file__).parent
TEMPLATE, STYLE = "page.html.j2", "page.css"
FOOTER = html(
    """This page holds all of its figures and numbers; tables and figures are also files in
    <span class="file">tables/</span> and <span class="file">figures/</span> beside it. Frequencies
    are in Hz, eigenvalues in rad²/s², times in wall seconds."""
)

FIRST_MODES = 12
"""Elastic modes listed from the first on; beyond them `HIGHER_MODES`."""
HIGHER_MODES = (24, 32, 48, 64, 96, 128, 192, 256)


class Section(NamedTuple):
    """A section of a page: its anchor, its heading, that in the menu if shorter, its content."""

    id: str
    title: str
    content: Markup
    menu: str = ""


def section(title: str, *parts: Any, id: str = "", menu: str = "") -> Section:
    """A section of parts, without those that are empty; its anchor is its entry in the menu."""
    return Section(id or (menu or title).lower(), title, together(*parts), menu)


def origins(table: Table, config: str = "config.yaml in the folder above this page") -> Section:
    """The last section: machines, commands, and where the configuration lies."""
    return section("Provenance", machine(table, config))


@dataclass(frozen=True)
class StudyPage:
    """A page."""

    title: str
    kicker: str
    lede: str
    """Heading, the words above it, the paragraph below it."""
    sections: Iterable[Section | None]
    """In their order; those that are None are left out."""
    footer: str = FOOTER
    """Last paragraph."""

    def __str__(self) -> str:
        """The page as HTML."""
        style = Markup((HERE / STYLE).read_text())
        sections = [section for section in self.sections if section]
        return _template().render(page=self, sections=sections, style=style)


@cache
def _template() -> Template:
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.from_string((HERE / TEMPLATE).read_text())


def listed_modes(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Of rows with a `mode` from the first elastic one on, those that a page lists."""
    higher = [row for row in rows[FIRST_MODES:] if row["mode"] in HIGHER_MODES]
    return rows[:FIRST_MODES] + higher
