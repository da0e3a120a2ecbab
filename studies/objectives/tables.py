"""Tables of the objectives' study: frequency errors, what proves them, what was compared."""

from __future__ import annotations

import inspect
import statistics
from collections.abc import Iterable, Iterator, Mapping

import numpy as np
import pandas as pd

import carillon.fem.materials
from carillon.fem.model import RIGID_MODES
from dataset_gen.objectives.fitting import module_of
from solver.coarsening.forest import FOREST
from studies.base.cases import Case
from studies.base.entry import Row
from studies.objectives.results import Objectives

FIRST = RIGID_MODES + 1
ALL = "all"
"""Stands for every material in the pooled tables."""
BASELINES = {
    "galerkin": "No fit: the moduli that give the Galerkin projection of the fine stiffness.",
    "average": "No fit: the mean of the block’s eight moduli at every point.",
}


def summary(study: Objectives) -> list[Row]:
    """Errors of modes 7..60 by objective and material."""
    return _pooled(study, "audible")


def summary_all(study: Objectives) -> list[Row]:
    """Errors of all modes by objective and material."""
    return _pooled(study, "all")


def _pooled(study: Objectives, part: str) -> list[Row]:
    errors = pd.DataFrame(
        {
            "coarsening": row["coarsening"],
            "material": material,
            "square": row[part]["rms"] ** 2,
            "worst": row[part]["worst"],
            "where": f"{study.label(case)}, mode {row[part]['worst_mode']}",
        }
        for case, rating in study.ratings.items()
        for row in rating["rows"]
        for material in (case.material, ALL)
    )
    rows: dict[str, Row] = {name: {"coarsening": name} for name in study.coarsenings}
    for (name, material), group in errors.groupby(["coarsening", "material"], sort=False):
        worst = group.loc[group["worst"].abs().idxmax()]
        rows[name] |= {
            f"{material}_rms": float(np.sqrt(group["square"].mean())),
            f"{material}_worst": float(worst["worst"]),
            f"{material}_where": worst["where"],
        }
    return sorted(rows.values(), key=lambda row: row["all_rms"])


def errors(study: Objectives) -> Iterator[Row]:
    """Every coarsening of every case."""
    for case, rating in study.ratings.items():
        for row in rating["rows"]:
            yield {**rating, **row, **study.identity(case)}


def forest(study: Objectives) -> Iterator[Row]:
    """Errors of the forests over those of their fit, by solid; no rows without both."""
    ratios = {case: study.forest_over_fit(case) for case in study.ratings}
    known = {case: ratio for case, ratio in ratios.items() if ratio is not None}
    if not known:
        return
    for solid in study.solids:
        of_solid = {case: ratio for case, ratio in known.items() if case.solid == solid}
        yield _forest_row(study, study.titles[solid], of_solid)
    if len(study.solids) > 1:
        yield _forest_row(study, "All solids", known)


def _forest_row(study: Objectives, title: str, ratios: dict[Case, float]) -> Row:
    assert study.forest is not None
    worst = max(ratios, key=ratios.__getitem__)

    def pooled(coarsening: str) -> float:
        return float(np.sqrt(np.mean([study.rms(case, coarsening) ** 2 for case in ratios])))

    return {
        "title": title,
        "cases": len(ratios),
        "forest_rms": pooled(FOREST),
        "fit_rms": pooled(study.forest["forest_objective"]),
        "median": statistics.median(ratios.values()),
        "worst": ratios[worst],
        "where": study.label(worst),
    }


def truths(study: Objectives) -> Iterator[Row]:
    """Size and proof of every ground truth."""
    for case, rating in study.ratings.items():
        truth = rating["truth"]
        counted = "inertia_count" in truth
        proof = f"{truth['inertia_expected']} / {truth['inertia_count']}" if counted else None
        yield {**rating, **truth, **study.identity(case), "inertia": proof}


def objectives(study: Objectives) -> Iterable[Row]:
    """What each objective is."""
    return [
        {"coarsening": name, "description": description(name, study.forest)}
        for name in study.coarsenings
    ]


def description(coarsening: str, forest: Mapping[str, str] | None = None) -> str:
    """What a baseline or the forests are, or the first line of an objective's documentation."""
    if coarsening in BASELINES:
        return BASELINES[coarsening]
    if coarsening == FOREST:
        assert forest is not None
        return (
            f"No fit: regression forests that have learned {forest['forest_objective']}; "
            f"{forest['forest']}, SHA-256 {forest['forest_sha256']}…"
        )
    first = _first_line(module_of(coarsening))
    text = first.removeprefix(f"Objective `{coarsening}`:").replace("`", "").strip()
    return text[:1].upper() + text[1:]


def materials(study: Objectives) -> Iterable[Row]:
    """What each material is."""
    functions = {name: name.replace("-", "_") for name in study.part["materials"]}
    return [
        {"material": name, "description": _first_line(getattr(carillon.fem.materials, function))}
        for name, function in functions.items()
    ]


def _first_line(documented: object) -> str:
    return (inspect.getdoc(documented) or "").split("\n", 1)[0]
