"""The study of discretisations as one page."""

from __future__ import annotations

from studies.base.page import inline, rendered
from studies.base.table import Table
from studies.discretisation.results import DiscretisationStudy
from studies.discretisation.tables import FIRST


def page(study: DiscretisationStudy, tables: dict[str, Table]) -> str:
    """Build the page from the tables and figures of a study; nothing is computed anew."""
    rows = tables["summary"].rows
    best = [
        min(
            (row for row in rows if row["material"] == material),
            key=lambda row: row["solid_median"],
        )
        for material in study.part["materials"]
    ]
    return rendered(
        "studies/discretisation/page.html.j2",
        title="Voxels, coarse elements or finite cells?",
        config=study.config,
        tables=tables,
        best=best,
        without=study.without,
        span=f"{FIRST}–{study.last}",
        figures={name: inline(study.figure(f"{name}.svg")) for name in ("unknowns", "seconds")},
    )
