"""A comparison as files: Markdown and a page for people, CSV and JSON for programs."""

from __future__ import annotations

from dataclasses import asdict
from itertools import groupby
from pathlib import Path
from typing import Any

from carillon.files import atomic_path
from workflow.compare import tables
from workflow.compare.cells import Cell, Comparison
from workflow.compare.differences import Difference, dates, of_conditions, of_configurations
from workflow.compare.noise import RULES
from workflow.report.conditions import LABELS
from workflow.report.page import page_template
from workflow.report.table import Table
from workflow.room import make_folder

NAME = "comparison"
MACHINE = ("processor", "cores", "memory", "ranks", "threads", "blas")
"""Conditions on which times depend, whatever the code."""
MOST_MOVED = 25
"""Moved numbers of a table that people are told; all are in the CSV file."""
MOST_LISTED = 200
"""Numbers of a table up to which the page lists all of them."""
TITLE = "What moved"


def write(comparison: Comparison, folder: Path) -> None:
    """Write `comparison.csv`, `comparison.md` and `comparison.html`."""
    make_folder(folder)
    for ending, text in (
        ("csv", tables.every_number(comparison).as_csv()),
        ("md", as_markdown(comparison)),
        ("html", as_page(comparison)),
    ):
        with atomic_path(folder / f"{NAME}.{ending}") as temporary:
            temporary.write_text(text, encoding="utf-8")


def as_json(comparison: Comparison) -> dict[str, Any]:
    """What differs and what moved, as plain values."""
    return {
        "before": str(comparison.before.path),
        "now": str(comparison.now.path),
        "conditions": [asdict(item) for item in _conditions(comparison)],
        "configuration": [asdict(item) for item in _configuration(comparison)],
        "compared": len(comparison.cells),
        "moved": tables.every_number(_only_moved(comparison)).rows,
        "only_before": comparison.only_before,
        "only_now": comparison.only_now,
    }


def as_text(comparison: Comparison, most: int = MOST_MOVED) -> str:
    """The short form, for a terminal."""
    lines = [f"{comparison.before.path} (baseline) and {comparison.now.path} (this run)"]
    lines += [
        f"  {item.what}: {tables.cut(item.before, 60)} -> {tables.cut(item.now, 60)}"
        + (f" ({tables.cut(item.where, 60)})" if item.where else "")
        for item in (*_conditions(comparison), *_configuration(comparison))
    ]
    lines += _caution(comparison)
    lines.append(tables.summary(comparison))
    moved = tables.worst_first(comparison.moved)
    lines += [f"  {_line(cell)}" for cell in moved[:most]]
    if len(moved) > most:
        lines.append(f"  and {len(moved) - most:,} more")
    for side, only in _one_sided(comparison):
        lines.append(f"{side}: {len(only)}, such as {only[0]}")
    return "\n".join(lines)


def _line(cell: Cell) -> str:
    return (
        f"{cell.verdict}: {cell.table}, {cell.row}, {cell.label}: "
        f"{cell.shown(cell.before)} -> {cell.shown(cell.now)}"
    )


def as_markdown(comparison: Comparison) -> str:
    """The comparison for a pull request or a log."""
    parts = [f"# {TITLE}", _sides(comparison), f"**{tables.summary(comparison)}.**"]
    parts += ["## Conditions", *_markdown_of(_difference_tables(comparison), "The same.")]
    parts += _caution(comparison)
    parts += ["## Moved"]
    for path, moved in _moved_by_table(comparison):
        parts += [f"### {path}", _rows(tables.listed(path, moved[:MOST_MOVED], False))]
        if len(moved) > MOST_MOVED:
            parts.append(f"And {len(moved) - MOST_MOVED:,} more, see {NAME}.csv.")
    if not comparison.moved:
        parts.append("Nothing.")
    parts += ["## By table", tables.counts(comparison).as_markdown()]
    for side, only in _one_sided(comparison):
        parts += [f"## {side}", "\n".join(f"- {name}" for name in only)]
    parts += ["## Rules", "\n".join(f"- {kind}: {rule}." for kind, rule in RULES.items())]
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def _markdown_of(found: list[Table], otherwise: str) -> list[str]:
    return [_rows(table) for table in found if table.rows] or [otherwise]


def _rows(table: Table) -> str:
    """A table in Markdown without its caption, which the heading says."""
    return table.as_markdown().strip("\n")


def as_page(comparison: Comparison) -> str:
    """The comparison as one self-contained page."""
    return page_template("compare/page.html.j2").render(
        title=TITLE,
        sides=_sides(comparison),
        summary=tables.summary(comparison),
        conditions=_difference_tables(comparison),
        cautions=_caution(comparison),
        moved=[
            (path, tables.listed(f"{path}-moved", moved[:MOST_MOVED], False), len(moved))
            for path, moved in _moved_by_table(comparison)
        ],
        most=MOST_MOVED,
        counts=tables.counts(comparison),
        listed=[
            tables.listed(path, cells, False)
            for path, cells in _by_table(comparison.cells)
            if len(cells) <= MOST_LISTED
        ],
        unlisted=[path for path, cells in _by_table(comparison.cells) if len(cells) > MOST_LISTED],
        one_sided=_one_sided(comparison),
        rules=RULES,
    )


def _sides(comparison: Comparison) -> str:
    before, now = comparison.before, comparison.now
    return (
        f"Baseline {before.path}, measured {dates(before)}; this run {now.path}, measured "
        f"{dates(now)}."
    )


def _caution(comparison: Comparison) -> list[str]:
    """A sentence about times where the machine is not the same; none otherwise."""
    found = {item.what for item in _conditions(comparison)}
    different = [LABELS[key] for key in MACHINE if LABELS[key] in found]
    if not different:
        return []
    return [f"Not the same: {', '.join(different)}; times that moved may tell about these alone."]


def _conditions(comparison: Comparison) -> list[Difference]:
    return of_conditions(comparison.before, comparison.now)


def _configuration(comparison: Comparison) -> list[Difference]:
    return of_configurations(comparison.before, comparison.now)


def _difference_tables(comparison: Comparison) -> list[Table]:
    return [
        tables.differences("conditions", "Condition", _conditions(comparison)),
        tables.differences("configuration", "Key", _configuration(comparison)),
    ]


def _moved_by_table(comparison: Comparison) -> list[tuple[str, list[Cell]]]:
    return [(path, tables.worst_first(cells)) for path, cells in _by_table(comparison.moved)]


def _by_table(cells: list[Cell]) -> list[tuple[str, list[Cell]]]:
    return [(path, list(group)) for path, group in groupby(cells, lambda cell: cell.table)]


def _one_sided(comparison: Comparison) -> list[tuple[str, list[str]]]:
    sides = [
        ("Only in the baseline", comparison.only_before),
        ("Only in this run", comparison.only_now),
    ]
    return [(side, only) for side, only in sides if only]


def _only_moved(comparison: Comparison) -> Comparison:
    return Comparison(
        comparison.before,
        comparison.now,
        comparison.moved,
        comparison.only_before,
        comparison.only_now,
    )
