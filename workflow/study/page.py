"""The study as one HTML page that carries its figures, tables and style within itself."""

from __future__ import annotations

from typing import Any

from solver.coarsening.forest import FOREST
from workflow.report.page import inline, page_template
from workflow.report.table import Table, read_table
from workflow.study.cases import Study, without
from workflow.study.errors_tables import FIRST
from workflow.study.goals import rms_limits
from workflow.study.identity import label
from workflow.study.tables import BUILDERS


def render(study: Study) -> str:
    """Build the page from the tables and figures of a study; nothing is computed anew."""
    tables = {name: read_table(study.folder / "tables" / f"{name}.json") for name in BUILDERS}
    fits = [row for row in tables["summary"].rows if row["coarsening"] != FOREST]
    return page_template("study/page.html.j2").render(
        title="Which objective has the best spectra?",
        config=study.config,
        tables=tables,
        best=fits[0],
        forest=study.forest,
        without_forest=study.without_forest,
        baselines={row["coarsening"]: row for row in tables["summary"].rows},
        goals={row["coarsening"]: row for row in tables["goals"].rows},
        without=without(study.config),
        shortened=shortened(study),
        span=f"{FIRST}–{study.last_audible}",
        span_all=f"{FIRST}–{study.last}",
        coarsenings=study.coarsenings,
        solids=[_solid(study, tables["errors"], solid) for solid in study.solids],
    )


def shortened(study: Study) -> list[str]:
    """Cases whose coarse model has fewer modes than were asked for, in words."""
    return [
        f"{label(study, case)} ({last} modes)"
        for case, found in study.found.items()
        if (last := found["rows"][0]["all"]["last"]) < found["modes"]
    ]


def _solid(study: Study, errors: Table, solid: str) -> dict[str, Any]:
    rows = [row for row in errors.rows if row["model"] == solid]
    sizes = {row["resolution"]: (row["unknowns"], row["coarse_unknowns"]) for row in rows}
    return {
        "name": solid,
        "title": study.title(solid),
        "mesh": study.config["objectives"]["models"][solid]["mesh"],
        "sizes": sizes,
        "rows": rows,
        "limits": rms_limits(study, solid),
        "figure": inline(study.folder / "figures" / f"{solid}.svg"),
    }
