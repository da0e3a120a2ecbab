"""Pictures of the packages: boxes and arrows as SVG, from the arrows that the tests allow."""

from __future__ import annotations

from collections.abc import Mapping
from graphlib import TopologicalSorter
from html import escape

from tests.test_structure import ARROWS, ROOMS

WIDTH = 360
"""Of a picture [px]: that of a narrow telephone, so that letters stay as large as the text's."""
GAP, HEIGHT, LINE = 22, 30, 16
_HEAD = (
    '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7"'
    ' orient="auto"><path d="M0 0L8 4L0 8z"/></marker></defs>'
)

Needs = dict[str, set[str]]


def of_rooms() -> str:
    """The chain of the rooms, each with its packages; an arrow leads to what is imported."""
    parts, top = [], 1
    for number, room in enumerate(reversed(ROOMS)):
        packages = [name.removeprefix(f"{room}.") for name in ARROWS if name.startswith(f"{room}.")]
        lines = _lines(sorted(name for name in packages if name != "commands"))
        height = HEIGHT + LINE * len(lines)
        if number:
            parts.append(_arrow(WIDTH / 2, top - GAP, WIDTH / 2, top))
        parts.append(_box(1, top, WIDTH - 2, height, room, lines))
        top += height + GAP
    return _picture("".join(parts), top - GAP + 1, "The rooms: each imports those below it alone")


def of_packages(room: str) -> str:
    """The packages of a room; arrows that follow from others are left out."""
    inside = {name: set(needs.split()) & set(ARROWS) for name, needs in ARROWS.items()}
    inside = {
        name: {other for other in needs if _belongs(other, room)}
        for name, needs in inside.items()
        if _belongs(name, room)
    }
    levels = _levels(inside)
    places = {}
    for row, names in enumerate(reversed(levels)):
        step = WIDTH / len(names)
        for column, name in enumerate(names):
            places[name] = (step * (column + 0.5), row * (HEIGHT + 2 * GAP) + 1, step - 10)
    arrows = [
        _arrow(places[name][0], places[name][1] + HEIGHT, places[other][0], places[other][1])
        for name, needs in _reduced(inside).items()
        for other in sorted(needs)
    ]
    boxes = [
        _box(x - width / 2, y, width, HEIGHT, name.removeprefix(f"{room}.") or name, [])
        for name, (x, y, width) in places.items()
    ]
    height = len(levels) * (HEIGHT + 2 * GAP) - 2 * GAP + 2
    return _picture("".join(arrows + boxes), height, f"The packages of {room} and what they import")


def _belongs(name: str, room: str) -> bool:
    return name == room or name.startswith(f"{room}.")


def _levels(needs: Mapping[str, set[str]]) -> list[list[str]]:
    """Packages by the length of the longest way down from them, at most three beside each other."""
    level: dict[str, int] = {}
    for name in TopologicalSorter(needs).static_order():
        level[name] = max((level[other] + 1 for other in needs[name]), default=0)
    rows = [sorted(n for n in level if level[n] == k) for k in range(max(level.values()) + 1)]
    return [row[k : k + 3] for row in rows for k in range(0, len(row), 3)]


def _reduced(needs: Needs) -> Needs:
    """The arrows that do not follow from others."""
    reach: Needs = {}
    for name in TopologicalSorter(needs).static_order():
        reach[name] = needs[name].union(*(reach[other] for other in needs[name]))
    return {
        name: {o for o in others if not any(o in reach[p] for p in others if p != o)}
        for name, others in needs.items()
    }


def _lines(names: list[str]) -> list[str]:
    """Names as lines of text that fit into a box."""
    lines: list[str] = []
    for name in names:
        if lines and len(lines[-1]) + len(name) < 48:
            lines[-1] += f", {name}"
        else:
            lines.append(name)
    return lines


def _box(x: float, y: float, width: float, height: float, title: str, lines: list[str]) -> str:
    middle = x + width / 2
    small = "".join(
        f'<text class="small" x="{middle:.0f}" y="{y + 37 + LINE * k:.0f}" font-size="12" '
        f'text-anchor="middle">{escape(line)}</text>'
        for k, line in enumerate(lines)
    )
    return (
        f'<rect x="{x:.0f}" y="{y:.0f}" width="{width:.0f}" height="{height:.0f}" rx="5"/>'
        f'<text x="{middle:.0f}" y="{y + 20:.0f}" font-size="14" '
        f'text-anchor="middle">{escape(title)}</text>{small}'
    )


def _arrow(x1: float, y1: float, x2: float, y2: float) -> str:
    return f'<path d="M{x1:.0f} {y1:.0f}L{x2:.0f} {y2:.0f}" marker-end="url(#tip)"/>'


def _picture(content: str, height: float, title: str) -> str:
    return (
        f'<svg class="rooms" xmlns="http://www.w3.org/2000/svg" role="img" width="{WIDTH}" '
        f'height="{height:.0f}" viewBox="0 0 {WIDTH} {height:.0f}"><title>{escape(title)}</title>'
        f"{_HEAD}{content}</svg>"
    )
