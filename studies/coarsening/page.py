"""The study of the worst modes as one page."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from studies.base.page import inline, rendered
from studies.base.table import Table
from studies.coarsening.pictures import mode_pictures
from studies.coarsening.results import CoarseningStudy
from studies.coarsening.tables import FIRST, LABELS, METHODS, rank_correlation, speeds


def page(study: CoarseningStudy, tables: dict[str, Table]) -> str:
    """Build the page from the tables, figures and pictures of a study; nothing is computed anew."""
    plain, refined = tables["summary"].rows
    solids = [_solid(study, tables, solid) for solid in study.solids]
    return rendered(
        "studies/coarsening/page.html.j2",
        title="Which modes does a coarse model get wrong?",
        config=study.config,
        tables=tables,
        plain=plain,
        refined=refined,
        goals=study.goals,
        without=study.without,
        correlation=rank_correlation(study),
        speeds={METHODS[method]: speeds(study, method) for method in METHODS},
        span=f"{FIRST}–{study.last}",
        figures={name: inline(study.figure(f"{name}.svg")) for name in ("expected", "errors")},
        solids=[solid for solid in solids if solid],
        titled_modes=_with_titles(tables["modes"]),
        left=[row for row in tables["modes"].rows if row["of"] == LABELS["refined"]],
    )


def _with_titles(table: Table) -> Table:
    """The table with the column of the solid, which is hidden where the heading tells it."""
    columns = [
        replace(column, shown=True) if column.key == "title" else column for column in table.columns
    ]
    return replace(table, columns=columns)


def _solid(study: CoarseningStudy, tables: dict[str, Table], solid: str) -> dict[str, Any] | None:
    """What the page says of a solid; None if its plain models have no mode that is far off."""
    worst = study.worst_of(solid)
    if worst is None:
        return None
    case, mode = worst
    about = {**study.identity(case), "of": LABELS["plain"], "mode": mode["mode"]}
    return {
        "name": solid,
        "title": study.titles[solid],
        "mesh": study.part["models"][solid]["mesh"],
        "case": study.label(case),
        "mode": mode,
        "pictures": mode_pictures(study, case, mode["mode"]),
        "modes": [
            row
            for row in tables["modes"].rows
            if row["model"] == solid and row["of"] == LABELS["plain"]
        ],
        "elements": [
            row
            for row in tables["elements"].rows
            if all(row[key] == value for key, value in about.items())
        ],
    }
