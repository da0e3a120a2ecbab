"""Pictures of the packages: boxes and arrows as SVG, from the arrows that the tests allow."""

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
    """The packages of a room, but its commands; arrows that follow from others are left out."""
    needs = _between(room)
    places = {}
    rows = _rows(needs)
    for row, names in enumerate(rows):
        step = WIDTH / len(names)
        for column, name in enumerate(names):
            places[name] = (step * (column + 0.5), row * (HEIGHT + 2 * GAP) + 1, step - 6)
    arrows = [
        _arrow(places[name][0], places[name][1] + HEIGHT, places[other][0], places[other][1])
        for name, others in _reduced(needs).items()
        for other in sorted(others)
    ]
    boxes = [
        _box(x - width / 2, y, width, HEIGHT, name, [], 14 if width > 80 else 11)
        for name, (x, y, width) in places.items()
    ]
    height = len(rows) * (HEIGHT + 2 * GAP) - 2 * GAP + 2
    return _picture("".join(arrows + boxes), height, f"The packages of {room} and what they import")


def _between(room: str) -> Needs:
    """What the packages directly in a room import of each other, those below them included."""
    needs: Needs = {}
    for package, others in ARROWS.items():
        name = _name(package, room)
        if name is not None:
            inside = {_name(other, room) for other in others.split()} - {None, name}
            needs.setdefault(name, set()).update(other for other in inside if other is not None)
    return needs


def _name(package: str, room: str) -> str | None:
    """A package's part of a room's picture; none for others, and for commands, which use all."""
    parts = package.split(".")
    if parts[0] != room or parts[1:2] == ["commands"]:
        return None
    return parts[1] if len(parts) > 1 else room


def _rows(needs: Needs) -> list[list[str]]:
    """Packages in rows from the top: each below what imports it, unused ones above what they do."""
    users = {name: {user for user in needs if name in needs[user]} for name in needs}
    row: dict[str, int] = {}
    for name in TopologicalSorter(users).static_order():
        row[name] = max((row[user] + 1 for user in users[name]), default=0)
    for name in needs:
        if needs[name] and not users[name]:
            row[name] = min(row[other] for other in needs[name]) - 1
    return [sorted(name for name in row if row[name] == k) for k in range(max(row.values()) + 1)]


def _reduced(needs: Needs) -> Needs:
    reach: Needs = {}
    for name in TopologicalSorter(needs).static_order():
        reach[name] = needs[name].union(*(reach[other] for other in needs[name]))
    return {
        name: {o for o in others if not any(o in reach[p] for p in others if p != o)}
        for name, others in needs.items()
    }


def _lines(names: list[str]) -> list[str]:
    lines: list[str] = []
    for name in names:
        if lines and len(lines[-1]) + len(name) < 48:
            lines[-1] += f", {name}"
        else:
            lines.append(name)
    return lines


def _box(
    x: float, y: float, width: float, height: float, title: str, lines: list[str], size: int = 14
) -> str:
    middle = x + width / 2
    small = "".join(
        f'<text class="small" x="{middle:.0f}" y="{y + 37 + LINE * k:.0f}" font-size="12" '
        f'text-anchor="middle">{escape(line)}</text>'
        for k, line in enumerate(lines)
    )
    return (
        f'<rect x="{x:.0f}" y="{y:.0f}" width="{width:.0f}" height="{height:.0f}" rx="5"/>'
        f'<text x="{middle:.0f}" y="{y + 20:.0f}" font-size="{size}" '
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
