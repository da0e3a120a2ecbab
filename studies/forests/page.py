"""The study of the forests as one page."""

from __future__ import annotations

from typing import Any

from dataset_gen.objectives import closed_form
from studies.base.page import inline, rendered
from studies.base.table import Table
from studies.forests.results import ForestsStudy

FIGURES = ("blocks", "variants", "curve", "sizes")


def page(study: ForestsStudy, tables: dict[str, Table]) -> str:
    """Build the page from the tables and figures of the study; nothing is computed anew."""
    return rendered(
        "studies/forests/page.html.j2",
        title="What are the forests worth?",
        tables=tables,
        figures={name: inline(study.figure(f"{name}.svg")) for name in FIGURES},
        model=study.model,
        findings=findings(study),
    )


def findings(study: ForestsStudy) -> dict[str, Any]:
    """The numbers of the page's head: the forests beside the fit that they learned."""
    objective = study.model["objective"]
    blocks = study.result("blocks")
    first = blocks[0]
    rows = {
        row["method"]: row
        for row in blocks
        if all(row[key] == first[key] for key in ("range_gpa", "distribution", "fill", "scaled_by"))
    }
    forest = next(row for name, row in rows.items() if name.startswith(f"{objective}, forests"))
    fit = rows[f"{closed_form(objective)}, fitted on the spot"]
    return {
        "forest": forest,
        "fit": fit,
        "speed_up": fit["seconds_per_block"] / forest["seconds_per_block"],
    }
