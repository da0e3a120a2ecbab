"""Tables of the objectives' study: frequency errors, what proves them, what was compared."""

from __future__ import annotations

import inspect
import statistics
from collections.abc import Callable, Iterable, Iterator, Mapping

import numpy as np
import pandas as pd

import carillon.fem.materials
from dataset_gen.objectives.fitting import module_of
from solver.coarsening.forest import FOREST
from studies.base.cases import ALL, CASE_COLUMNS, Case, error_columns, truths_of
from studies.base.table import Column, Row, Tabulation, hidden, table
from studies.objectives.goals import goal_cases as goal_cases
from studies.objectives.goals import goals as goals
from studies.objectives.results import FIRST, Objectives

BASELINES = {
    "galerkin": "No fit: the moduli that give the Galerkin projection of the fine stiffness.",
    "average": "No fit: the mean of the block’s eight moduli at every point.",
}


def _errors_of(part: str) -> Callable[[Callable[[Objectives], list[Row]]], Tabulation]:
    """Make a table of a function that pools the errors of a part of the modes."""
    return table(
        lambda study: (
            f"""Relative errors of the frequencies of modes {FIRST}–{study.last(part)} against
            SLEPc on the fine mesh, modes matched by index, by objective and material: root mean
            square over all solids and resolutions, each weighing the same, and the worst single
            frequency, negative if too low. The smallest rms over all materials comes first."""
        ),
        lambda study: [
            Column("coarsening", "Objective"),
            *error_columns(study.part["materials"]),
        ],
    )


@_errors_of("audible")
def summary(study: Objectives) -> list[Row]:
    """Errors of modes 7..60 by objective and material."""
    return _pooled(study, "audible")


@_errors_of("all")
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


@table(
    """Relative errors of the frequencies against SLEPc on the fine mesh: root mean square, mean
    and worst, the last two positive if too high. Times are wall seconds on one core with other
    jobs beside it: of the fits, equal blocks once, with what each void pattern needs once, and
    of the coarse model’s modes by SLEPc.""",
    lambda study: [
        *CASE_COLUMNS,
        Column("unknowns", "Unknowns", "count", source="n_dofs"),
        Column("coarse_unknowns", "coarsened", "count", source="coarse_n_dofs"),
        Column("coarsening", "Objective"),
        *(
            column
            for part in ("audible", "all")
            for column in (
                Column(
                    f"{part}_rms",
                    f"Modes {FIRST}–{study.last(part)}, rms",
                    "percent",
                    source=f"{part}.rms",
                ),
                Column(f"{part}_mean", "mean", "percent", source=f"{part}.mean"),
                Column(f"{part}_worst", "worst", "percent", source=f"{part}.worst"),
                Column(f"{part}_worst_mode", "at mode", "count", source=f"{part}.worst_mode"),
            )
        ),
        hidden("last", "Last mode compared", "count", source="all.last"),
        Column("converged", "Fits converged", "percent"),
        Column("fit_seconds", "Fits", "seconds"),
        Column("solve_seconds", "Modes", "seconds"),
    ],
)
def errors(study: Objectives) -> Iterator[Row]:
    """Every coarsening of every case."""
    for case, rating in study.ratings.items():
        for row in rating["rows"]:
            yield {**rating, **row, **study.identity(case)}


@table(
    lambda study: (
        f"""The forests against the fit that they learned, block by block: rms errors of modes
        {FIRST}–{study.last("audible")} against SLEPc on the fine mesh, pooled over a solid’s
        resolutions and materials, and the ratio of both, case by case."""
    ),
    [
        Column("title", "Solid"),
        Column("cases", "Cases", "count"),
        Column("forest_rms", "Forests, rms", "percent"),
        Column("fit_rms", "Fit, rms", "percent"),
        Column("median", "Forests over fit, median", "percent"),
        Column("worst", "largest", "percent"),
        Column("where", "at"),
    ],
)
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


@table(
    """Ground truth of every case by SLEPc on the fine mesh: eigenvalues found below a shift μ,
    and counted there by the inertia of K − μM; wall seconds on one core.""",
    [
        *CASE_COLUMNS,
        Column("unknowns", "Unknowns", "count", source="n_dofs"),
        Column("coarse_unknowns", "coarsened", "count", source="coarse_n_dofs"),
        Column("blocks", "Blocks", "count"),
        Column("distinct_blocks", "distinct", "count"),
        Column("modes", "Modes", "count"),
        Column("inertia", "Found / counted"),
        Column("residual_max", "Largest residual", "small"),
        Column("orthogonality", "|XᵀMX − I|", "small"),
        Column("seconds", "Time", "seconds"),
    ],
)
def truths(study: Objectives) -> Iterator[Row]:
    """Size and proof of every ground truth."""
    return truths_of(study)


@table(
    """What is fitted, block by block; the last two coarsen without a fit.""",
    [
        Column("coarsening", "Objective"),
        Column("description", "What it is"),
    ],
)
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


@table(
    """Young’s modulus from voxel to voxel; Poisson’s ratio and density are the same everywhere.""",
    [
        Column("material", "Material"),
        Column("description", "What it is"),
    ],
)
def materials(study: Objectives) -> Iterable[Row]:
    """What each material is."""
    functions = {name: name.replace("-", "_") for name in study.part["materials"]}
    return [
        {"material": name, "description": _first_line(getattr(carillon.fem.materials, function))}
        for name, function in functions.items()
    ]


def _first_line(documented: object) -> str:
    return (inspect.getdoc(documented) or "").split("\n", 1)[0]
