"""The study of the forests as one HTML page that carries its figures, tables and style."""

from __future__ import annotations

from typing import Any

from dataset_gen.objectives import closed_form
from workflow.forests_study.plots import FIGURES
from workflow.forests_study.results import ForestsStudy
from workflow.forests_study.tables import BUILDERS
from workflow.report.page import inline, page_template
from workflow.report.table import read_table


def render(study: ForestsStudy) -> str:
    """Build the page from the tables and figures of the study; nothing is computed anew."""
    tables = {name: read_table(study.folder / "tables" / f"{name}.json") for name in BUILDERS}
    return page_template("forests_study/page.html.j2").render(
        title="What are the forests worth?",
        tables=tables,
        figures={name: inline(study.folder / "figures" / f"{name}.svg") for name in FIGURES},
        model=study.model,
        findings=findings(study),
    )


def findings(study: ForestsStudy) -> dict[str, Any]:
    """The numbers of the page's head: the forests beside the fit that they learned."""
    objective = study.model["objective"]
    first = study.blocks[0]
    rows = {
        row["method"]: row
        for row in study.blocks
        if all(row[key] == first[key] for key in ("range_gpa", "distribution", "fill", "scaled_by"))
    }
    forest = next(row for name, row in rows.items() if name.startswith(f"{objective}, forests"))
    fit = rows[f"{closed_form(objective)}, fitted on the spot"]
    return {
        "forest": forest,
        "fit": fit,
        "speed_up": fit["seconds_per_block"] / forest["seconds_per_block"],
    }
