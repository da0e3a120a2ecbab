"""A comparison as files: Markdown and a page for people, CSV and JSON for programs."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from carillon.files.atomic import atomic_path
from studies.base.conditions import LABELS
from studies.base.numbers import show
from studies.base.page import StudyPage, section
from studies.base.parts import bullets, div, element, grid, html, listed, prose
from studies.base.table import Column, Row, Table, hidden, table
from studies.comparison.cells import ENDS, KEYS
from studies.comparison.comparison import SIDES, Comparison
from studies.comparison.differences import Difference, dates
from studies.comparison.noise import BETTER, OTHER, RULES, VERDICTS, WORSE
from workflow.disk_space import make_folder

NAME = "comparison"
MACHINE = ("processor", "cores", "memory", "ranks", "threads", "blas")
"""Conditions on which times depend, whatever the code."""
MOST_MOVED = 25
"""Moved numbers of a table that people are told; all are in the CSV file."""
MOST_LISTED = 200
"""Numbers of a table up to which the page lists all of them."""
TITLE = "What moved"
RAW = [*KEYS, "kind", *(f"{side}{end}" for side in SIDES for end in ENDS), "ratio", "verdict"]
CLASSES = {"worse": WORSE, "better": BETTER, "other": OTHER}
MARKS = {**dict.fromkeys(WORSE, "worse"), **dict.fromkeys(BETTER, "better")}
"""Marks of verdicts on a page."""


def write(comparison: Comparison, folder: Path) -> None:
    """Write `comparison.csv`, `comparison.md` and `comparison.html`."""
    make_folder(folder)
    for ending, text in (
        ("csv", EVERY_NUMBER(comparison.cells).as_csv()),
        ("md", as_markdown(comparison)),
        ("html", str(as_page(comparison))),
    ):
        with atomic_path(folder / f"{NAME}.{ending}") as temporary:
            temporary.write_text(text, encoding="utf-8")


def as_json(comparison: Comparison) -> dict[str, Any]:
    """What differs and what moved, as plain values."""
    before, now = comparison.before, comparison.now
    return {
        "before": str(before.path),
        "now": str(now.path),
        "conditions": comparison.conditions,
        "configuration": comparison.configuration,
        "compared": len(comparison.cells),
        "moved": comparison.moved.sort_index()[RAW].to_dict("records"),
        "only_before": comparison.only_before,
        "only_now": comparison.only_now,
    }


def as_text(comparison: Comparison) -> str:
    """The short form, for a terminal."""
    before, now = comparison.before, comparison.now
    lines = [f"{before.path} (baseline) and {now.path} (this run)"]
    for item in (*comparison.conditions, *comparison.configuration):
        where = f" ({_cut(item['where'])})" if item["where"] else ""
        lines.append(f"  {item['what']}: {_cut(item['before'])} -> {_cut(item['now'])}{where}")
    lines += [*_caution(comparison), summary(comparison)]
    for cell in comparison.moved.head(MOST_MOVED).to_dict("records"):
        place = f"{cell['verdict']}: {cell['table']}, {cell['row']}, {cell['label']}"
        lines.append(f"  {place}: {cell['before_shown']} -> {cell['now_shown']}")
    if len(comparison.moved) > MOST_MOVED:
        lines.append(f"  and {len(comparison.moved) - MOST_MOVED:,} more")
    sides = _one_sided(comparison).items()
    lines += [f"{side}: {len(only)}, such as {only[0]}" for side, only in sides]
    return "\n".join(lines)


def as_markdown(comparison: Comparison) -> str:
    """The comparison for a pull request or a log."""
    parts = [f"# {TITLE}", _sides(comparison), f"**{summary(comparison)}.**", "## Conditions"]
    parts += [each.as_markdown() for each in _differing(comparison)] or ["The same."]
    parts += [*_caution(comparison), "## Moved"]
    for path, moved in _by_table(comparison.moved):
        parts += [f"### {path}", _listed(path, moved.head(MOST_MOVED)).as_markdown()]
        if len(moved) > MOST_MOVED:
            parts.append(f"And {len(moved) - MOST_MOVED:,} more, see {NAME}.csv.")
    if comparison.moved.empty:
        parts.append("Nothing.")
    parts += ["## By table", counts(comparison.cells).as_markdown()]
    for side, only in _one_sided(comparison).items():
        parts += [f"## {side}", "\n".join(f"- {name}" for name in only)]
    parts += ["## Rules", "\n".join(f"- {kind}: {rule}." for kind, rule in RULES.items())]
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def as_page(comparison: Comparison) -> StudyPage:
    """The comparison as one self-contained page."""
    by_table = _by_table(comparison.cells)
    all_of_them = html('see <span class="file">{}.csv</span>', NAME)
    differing = [grid(table, caption=False) for table in _differing(comparison)]
    same = prose("Machine, versions, commit and configuration are the same.")
    moved = []
    for path, cells in _by_table(comparison.moved):
        table = _listed(f"{path}-moved", cells.head(MOST_MOVED))
        moved += [element("h3", path), grid(table, caption=False, by="verdict")]
        if (more := len(cells) - MOST_MOVED) > 0:
            moved.append(prose(html("And {:count} more, {}.", more, all_of_them)))
    tables = [_listed(path, cells) for path, cells in by_table if len(cells) <= MOST_LISTED]
    unlisted = ", ".join(path for path, cells in by_table if len(cells) > MOST_LISTED)
    counted = counts(comparison.cells)
    one_sided = _one_sided(comparison)
    only = (element("p", f"{side}:") + bullets(names) for side, names in one_sided.items())
    rules = bullets(f"{kind}: {rule}." for kind, rule in RULES.items())
    return StudyPage(
        title=TITLE,
        kicker="comparison of two runs",
        lede=f"{summary(comparison)}.",
        sections=[
            section(
                "Conditions",
                prose(_sides(comparison)),
                *(differing or [same]),
                *map(prose, _caution(comparison)),
            ),
            section("Moved", *(moved or [prose("Nothing moved beyond noise.")])),
            section(
                "By table",
                grid(counted, caption=False),
                prose(counted.caption),
                *(
                    listed(f"{each.name}, number by number", grid(each, caption=False, by="row"))
                    for each in tables
                ),
                prose(unlisted and html("Too long for this page: {}, {}.", unlisted, all_of_them)),
                id="tables",
            ),
            section("On one side", div("prose", *only), id="only") if one_sided else None,
            section(
                "Rules",
                prose(
                    """A number counts as moved when it differs by more than noise. What that is
                    depends on the number:"""
                ),
                div("prose", rules),
            ),
        ],
        footer=html(
            'Every number of both folders, raw: <span class="file">{}.csv</span> beside this page.',
            NAME,
        ),
    )


def summary(comparison: Comparison) -> str:
    """What became of the numbers, in one sentence."""
    counted = comparison.moved["verdict"].value_counts()
    parts = [f"{show(counted[name], 'count')} {name}" for name in VERDICTS if name in counted]
    numbers = f"{show(len(comparison.cells), 'count')} numbers compared"
    return f"{numbers}: {', '.join(parts) if parts else 'none moved beyond noise'}"


def records(cells: pd.DataFrame) -> list[Row]:
    """Numbers side by side."""
    rows: list[Row] = cells.assign(mark=cells["verdict"].map(MARKS).fillna("")).to_dict("records")
    return rows


EVERY_NUMBER = table(*(Column(name, name) for name in RAW), keys="table row column", name=NAME)(
    records
)
LISTED = table(
    hidden("table", "Table"),
    Column("row", "Row"),
    Column("label", "Quantity"),
    Column("verdict", "Verdict"),
    hidden("verdict_mark", "Its mark", source="mark"),
    Column("before", "Baseline", source="before_shown"),
    Column("now", "This run", source="now_shown"),
    Column("ratio", "Ratio", "times"),
    keys="table row column",
)(records)


@table(
    Column("table", "Table"),
    Column("compared", "Compared", "count"),
    Column("worse", "Worse", "count"),
    Column("better", "Better", "count"),
    Column("other", "Changed otherwise", "count"),
)
def counts(cells: pd.DataFrame) -> list[Row]:
    """Numbers that both folders have, by table. Worse is slower, less accurate or larger, better
    the opposite; what changed otherwise is neither."""
    of = {name: cells["verdict"].isin(verdicts) for name, verdicts in CLASSES.items()}
    summed = pd.DataFrame({"compared": 1, **of}).groupby(cells["table"], sort=False).sum()
    rows: list[Row] = summed.reset_index().to_dict("records")
    return rows


def _differing_table(name: str, what: str, differences: list[Difference], apart: bool) -> Table:
    columns = [Column("what", what), Column("before", "Baseline"), Column("now", "This run")]
    columns.append(Column("where", "Tables", shown=apart))
    rows = [{**each, "where": each["where"] or "all"} for each in differences]
    return Table(name, "", columns, rows)


def _listed(name: str, cells: pd.DataFrame) -> Table:
    return replace(LISTED(cells), name=name)


def _by_table(cells: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    order = list(dict.fromkeys(cells.sort_index()["table"]))
    return [(path, cells[cells["table"] == path]) for path in order]


def _sides(comparison: Comparison) -> str:
    before, now = comparison.before, comparison.now
    return (
        f"Baseline {before.path}, measured {dates(before)}; this run {now.path}, measured "
        f"{dates(now)}."
    )


def _caution(comparison: Comparison) -> list[str]:
    """A sentence about times where the machine is not the same; none otherwise."""
    differing_labels = {item["what"] for item in comparison.conditions}
    different = [LABELS[key] for key in MACHINE if LABELS[key] in differing_labels]
    if not different:
        return []
    return [f"Not the same: {', '.join(different)}; times that moved may tell about these alone."]


def _differing(comparison: Comparison) -> list[Table]:
    apart = any(each["where"] for each in comparison.conditions)
    tables = (
        _differing_table("conditions", "Condition", comparison.conditions, apart),
        _differing_table("configuration", "Key", comparison.configuration, apart=False),
    )
    return [table for table in tables if table.rows]


def _one_sided(comparison: Comparison) -> dict[str, list[str]]:
    before, now = comparison.only_before, comparison.only_now
    sides = {"Only in the baseline": before, "Only in this run": now}
    return {side: only for side, only in sides.items() if only}


def _cut(text: str, length: int = 60) -> str:
    return text if len(text) <= length else f"{text[: length - 1]}…"
