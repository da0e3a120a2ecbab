"""The study of the discretisations as one page."""

from __future__ import annotations

from studies.accuracy.results import AccuracyStudy
from studies.base.page import inline, rendered
from studies.base.table import Table

FIGURES = ("unknowns", "seconds")


def page(study: AccuracyStudy, tables: dict[str, Table]) -> str:
    """Build the page from the tables and figures of a study; nothing is computed anew."""
    return rendered(
        "studies/accuracy/page.html.j2",
        title="How near do the frequencies come to those of the solid?",
        tables=tables,
        measured=study.measured,
        without=study.without,
        figures={name: inline(study.figure(f"{name}.svg")) for name in FIGURES},
        problems=[row for row in tables["levels"].rows if row.get("problem")],
    )
