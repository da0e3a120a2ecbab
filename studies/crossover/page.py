"""The study as one page."""

from itertools import groupby

from markupsafe import Markup

from studies.base.page import StudyPage, origins, section
from studies.base.parts import article, bullets, grid, html, note, plot, prose
from studies.base.table import Row, Table
from studies.crossover.plots import panel_title
from studies.crossover.results import Crossover
from studies.crossover.winners import PANEL, verdict

FIGURES = {
    "seconds": """Wall time from the moduli to the modes over unknowns; both axes are logarithmic,
        and marks are hollow where the eigenvalues are not within the tolerance.""",
    "memory": """Largest peak memory of a rank over unknowns, at the smallest tolerance; both axes
        are logarithmic.""",
}


DISTURBING = 0.2
"""Cores in use by other programs from which on a run counts as disturbed."""


def page(study: Crossover, tables: dict[str, Table]) -> StudyPage:
    """Build the page from the tables and figures of a study; nothing is computed anew."""
    cells, runs = tables["fastest"], tables["runs"]
    machines = ", ".join(dict.fromkeys(row["machine"] for row in runs.rows))
    failures = [_failure(row) for row in runs.rows if row.get("problem")]
    panels = groupby(cells.rows, key=lambda row: [row.get(key) for key in PANEL])
    grids = [_panel(cells, list(rows), number) for number, (_, rows) in enumerate(panels)]
    return StudyPage(
        title="Which method is the fastest where?",
        kicker="unknowns, modes, ranks and tolerances",
        lede=f"""{_counted(len(runs.rows), "run")} in {_counted(len(cells.rows), "case")} on
            {machines}: where does the
            paper’s HCMS win, with and without error correction, and where does another method?""",
        sections=[
            section(
                "Verdict",
                note(study.without),
                note(disturbed(runs.rows)),
                prose(" ".join(verdict(study.runs))),
                grid(tables["methods"]),
            ),
            section("Fastest", *grids),
            section("Time", plot(study.drawn("seconds"), FIGURES["seconds"], "seconds")),
            section("Memory", plot(study.drawn("memory"), FIGURES["memory"], "memory")),
            section(
                "Every run",
                prose("Runs that did not end with modes:") + bullets(failures) if failures else "",
                grid(runs, by="method"),
                menu="Runs",
            ),
            origins(tables["provenance"]),
        ],
    )


def disturbed(rows: list[Row]) -> str:
    """One sentence about other programs that ran beside the runs; empty if there were none."""
    ended = [row["others"] for row in rows if row.get("others") is not None]
    count = sum(each > DISTURBING for each in ended)
    if not count:
        return ""
    return (
        f"Beside {count} of {len(ended)} runs other programs had more than {DISTURBING:g} cores, "
        f"up to {max(ended):.1f}: their wall times are too long, and winners uncertain."
    )


def _panel(cells: Table, rows: list[Row], number: int) -> Markup:
    """The table of a tolerance and launch; the first has the caption."""
    about = {key: rows[0].get(key) for key in PANEL}
    several = len({row["machine"] for row in cells.rows}) > 1
    title = panel_title(about, several)
    return article(
        f"fastest-{number}",
        title[0].upper() + title[1:],
        grid(cells, rows, caption=number == 0, by="unknowns"),
    )


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'s' * (count != 1)}"


def _failure(row: Row) -> Markup:
    size = html("{:count} unknowns, ", row["unknowns"]) if row.get("unknowns") else ""
    return html(
        "{title}, {size}{modes} modes, {where}, {label}: {problem}",
        size=size,
        where=panel_title(row),
        **{key: row[key] for key in ("title", "modes", "label", "problem")},
    )
