"""Table of what is lost when forests take the place of the fit that they learned."""

from __future__ import annotations

import statistics
from collections.abc import Iterator
from typing import Any

import numpy as np

from solver.coarsening.forest import FOREST
from workflow.report.table import Column, Table
from workflow.study.cases import Case, Study
from workflow.study.errors_tables import FIRST
from workflow.study.identity import label

ALL = "All solids"


def forest(study: Study) -> Table:
    """Errors of the forests over those of their fit, by solid; no rows without both."""
    return Table(
        "forest",
        f"The forests against the fit that they learned, block by block: rms errors of modes "
        f"{FIRST}–{study.last_audible} against SLEPc on the fine mesh, pooled over a solid’s "
        "resolutions and materials, and the ratio of both, case by case.",
        [
            Column("title", "Solid"),
            Column("cases", "Cases", "count"),
            Column("forest_rms", "Forests, rms", "percent"),
            Column("fit_rms", "Fit, rms", "percent"),
            Column("median", "Forests over fit, median", "percent"),
            Column("worst", "largest", "percent"),
            Column("where", "at"),
        ],
        list(_rows(study)),
    )


def _rows(study: Study) -> Iterator[dict[str, Any]]:
    ratios = {case: study.forest_over_fit(case) for case in study.found}
    known = {case: ratio for case, ratio in ratios.items() if ratio is not None}
    if not known:
        return
    for solid in study.solids:
        yield _row(study, study.title(solid), {c: r for c, r in known.items() if c.solid == solid})
    if len(study.solids) > 1:
        yield _row(study, ALL, known)


def _row(study: Study, title: str, ratios: dict[Case, float]) -> dict[str, Any]:
    assert study.forest is not None
    worst = max(ratios, key=ratios.__getitem__)
    return {
        "title": title,
        "cases": len(ratios),
        "forest_rms": _pooled(study, FOREST, ratios),
        "fit_rms": _pooled(study, study.forest["forest_objective"], ratios),
        "median": statistics.median(ratios.values()),
        "worst": ratios[worst],
        "where": label(study, worst),
    }


def _pooled(study: Study, coarsening: str, cases: dict[Case, float]) -> float:
    return float(np.sqrt(np.mean([study.rms(case, coarsening) ** 2 for case in cases])))
