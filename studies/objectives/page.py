"""The study of the objectives as one page."""

from __future__ import annotations

from typing import Any

from solver.coarsening.forest import FOREST
from studies.base.page import inline, rendered
from studies.base.table import Table
from studies.objectives.goals import rms_limits
from studies.objectives.results import Objectives
from studies.objectives.tables import FIRST


def page(study: Objectives, tables: dict[str, Table]) -> str:
    """Build the page from the tables and figures of a study; nothing is computed anew."""
    fits = [row for row in tables["summary"].rows if row["coarsening"] != FOREST]
    return rendered(
        "studies/objectives/page.html.j2",
        title="Which objective has the best spectra?",
        config=study.config,
        tables=tables,
        best=fits[0],
        forest=study.forest,
        without_forest=study.without_forest,
        baselines={row["coarsening"]: row for row in tables["summary"].rows},
        goals={row["coarsening"]: row for row in tables["goals"].rows},
        without=study.without,
        shortened=shortened(study),
        span=f"{FIRST}–{study.last('audible')}",
        span_all=f"{FIRST}–{study.last('all')}",
        coarsenings=study.coarsenings,
        solids=[_solid(study, tables["errors"], solid) for solid in study.solids],
    )


def shortened(study: Objectives) -> list[str]:
    """Cases whose coarse model has fewer modes than were asked for, in words."""
    return [
        f"{study.label(case)} ({last} modes)"
        for case, rating in study.ratings.items()
        if (last := rating["rows"][0]["all"]["last"]) < rating["modes"]
    ]


def _solid(study: Objectives, errors: Table, solid: str) -> dict[str, Any]:
    rows = [row for row in errors.rows if row["model"] == solid]
    sizes = {row["resolution"]: (row["unknowns"], row["coarse_unknowns"]) for row in rows}
    return {
        "name": solid,
        "title": study.titles[solid],
        "mesh": study.part["models"][solid]["mesh"],
        "sizes": sizes,
        "rows": rows,
        "limits": rms_limits(study, solid),
        "figure": inline(study.figure(f"{solid}.svg")),
    }
