"""A comparison as tables: for programs every number, for people what moved."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Any

from workflow.compare.cells import Cell, Comparison
from workflow.compare.differences import Difference
from workflow.compare.noise import BETTER, CHANGED, GONE, NEW, VERDICTS, WORSE
from workflow.report.numbers import show
from workflow.report.table import LEAST, MOST, Column, Table

Row = dict[str, Any]


def every_number(comparison: Comparison) -> Table:
    """All numbers of both folders, raw."""
    sides = [
        Column(f"{side}{end}", f"{side}{end}")
        for side in ("before", "now")
        for end in ("", LEAST, MOST)
    ]
    keys = ["table", "row", "column"]
    return Table(
        "comparison",
        "Every number of both folders.",
        [
            *(Column(key, key) for key in (*keys, "kind")),
            *sides,
            Column("ratio", "ratio"),
            Column("verdict", "verdict"),
        ],
        [_raw(cell) for cell in comparison.cells],
        keys,
    )


def _raw(cell: Cell) -> Row:
    values = {
        f"{side}{end}": value
        for side, found in (("before", cell.before), ("now", cell.now))
        for end, value in (("", found.value), (LEAST, found.least), (MOST, found.most))
    }
    told = {name: getattr(cell, name) for name in ("table", "row", "column", "kind")}
    return {**told, **values, "ratio": cell.ratio, "verdict": cell.verdict}


def counts(comparison: Comparison) -> Table:
    """How many numbers of each table were compared, and what became of them."""
    columns = [
        Column("table", "Table"),
        Column("compared", "Compared", "count"),
        Column("worse", "Worse", "count"),
        Column("better", "Better", "count"),
        Column("other", "Changed otherwise", "count"),
    ]
    rows = []
    for path in dict.fromkeys(cell.table for cell in comparison.cells):
        cells = [cell for cell in comparison.cells if cell.table == path]
        rows.append({"table": path, "compared": len(cells), **_directions(cells)})
    return Table(
        "counts",
        "Numbers that both folders have, by table. Worse is slower, less accurate or larger, "
        "better the opposite; what changed otherwise is neither.",
        columns,
        rows,
    )


def _directions(cells: Iterable[Cell]) -> dict[str, int]:
    found = Counter(cell.verdict for cell in cells)
    return {
        name: sum(found[verdict] for verdict in verdicts)
        for name, verdicts in (
            ("worse", WORSE),
            ("better", BETTER),
            ("other", (CHANGED, GONE, NEW)),
        )
    }


def listed(name: str, cells: Iterable[Cell], with_table: bool = True) -> Table:
    """Numbers side by side, for people."""
    return Table(
        name,
        "",
        [
            Column("table", "Table", shown=with_table),
            Column("row", "Row"),
            Column("column", "Quantity"),
            Column("verdict", "Verdict"),
            Column("before", "Baseline"),
            Column("now", "This run"),
            Column("ratio", "Ratio", "times"),
        ],
        [
            {
                "table": cell.table,
                "row": cell.row,
                "column": cell.label,
                "verdict": cell.verdict,
                "verdict_mark": mark(cell),
                "before": cell.shown(cell.before),
                "now": cell.shown(cell.now),
                "ratio": cell.ratio,
            }
            for cell in cells
        ],
        ["table", "row", "column"],
    )


def mark(cell: Cell) -> str:
    """How the verdict is marked on a page."""
    return "worse" if cell.verdict in WORSE else "better" if cell.verdict in BETTER else ""


def worst_first(cells: Iterable[Cell]) -> list[Cell]:
    """Numbers that moved, by verdict and then by how far."""
    return sorted(cells, key=lambda cell: (VERDICTS.index(cell.verdict), -_distance(cell)))


def _distance(cell: Cell) -> float:
    ratio = abs(cell.ratio or 1.0)
    return max(ratio, 1.0 / ratio)


def differences(name: str, head: str, found: Iterable[Difference]) -> Table:
    """What is not the same, for people."""
    rows = [
        {"what": item.what, "before": item.before, "now": item.now, "where": item.where or "all"}
        for item in found
    ]
    return Table(
        name,
        "",
        [
            Column("what", head),
            Column("before", "Baseline"),
            Column("now", "This run"),
            Column("where", "Tables", shown=any(row["where"] != "all" for row in rows)),
        ],
        rows,
    )


def summary(comparison: Comparison) -> str:
    """What became of the numbers, in one sentence."""
    found = Counter(cell.verdict for cell in comparison.moved)
    told = [f"{show(found[verdict], 'count')} {verdict}" for verdict in VERDICTS if found[verdict]]
    numbers = f"{show(len(comparison.cells), 'count')} numbers compared"
    return f"{numbers}: {', '.join(told) if told else 'none moved beyond noise'}"


def cut(text: str, length: int) -> str:
    """A text of that length at most."""
    return text if len(text) <= length else f"{text[: length - 1]}…"
