"""Tables of the objectives' study: frequency errors, what proves them, what was compared."""

import inspect
import statistics
from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from dataset_gen.objectives.fitting import module_of
from solver.coarsening.forest import FOREST
from studies.base.cases import Case, case_columns, error_columns, pooled, truths_of
from studies.base.table import Column, Row, Tabulation, each, hidden, table
from studies.objectives.goals import goal_cases as goal_cases
from studies.objectives.goals import goals as goals
from studies.objectives.results import Objectives

BASELINES = {
    "galerkin": "No fit: the moduli that give the Galerkin projection of the fine stiffness.",
    "average": "No fit: the mean of the block’s eight moduli at every point.",
}
MATERIALS = {
    "uniform": "1 GPa everywhere.",
    "smooth": "0.1 to 10 GPa: a smooth random field as log10 of the modulus.",
    "two-region": (
        "A half of 10 GPa and one of 0.1 GPa, cut at the median across the longest extent."
    ),
    "random": "Independent in every cell, log-uniform over 0.01 to 10 GPa.",
    "noise": "Independent in every cell, uniform over 0.01 to 10 GPa: seldom soft.",
}
"""What each material is."""


def _errors_of(part: str, name: str) -> Tabulation:

    def rows(study: Objectives) -> list[Row]:
        errors = {
            name: {case: study.errors(case, name)[part] for case in study.ratings}
            for name in study.coarsenings
        }
        rows = [{"coarsening": name, **pooled(study, each)} for name, each in errors.items()]
        return sorted(rows, key=lambda row: row["all_rms"])

    rows.__doc__ = f"""Relative errors of the frequencies of modes 7–{{last[{part}]}} against SLEPc
        on the fine mesh, modes matched by index, by objective and material: root mean square over
        all solids and resolutions, each weighing the same, and the worst single frequency, negative
        if too low. The smallest rms over all materials comes first."""
    return table(
        Column("coarsening", "Objective"),
        lambda study: error_columns(study.part["materials"]),
        name=name,
    )(rows)


summary, summary_all = _errors_of("audible", "summary"), _errors_of("all", "summary-all")


@table(
    case_columns(),
    Column("unknowns", "Unknowns", "count", source="n_dofs"),
    Column("coarse_unknowns", "coarsened", "count", source="coarse_n_dofs"),
    Column("coarsening", "Objective"),
    lambda study: each(
        {part: f"7–{last}" for part, last in study.last.items()},
        Column("{name}_rms", "Modes {label}, rms", "percent", source="{name}.rms"),
        Column("{name}_mean", "mean", "percent", source="{name}.mean"),
        Column("{name}_worst", "worst", "percent", source="{name}.worst"),
        Column("{name}_worst_mode", "at mode", "count", source="{name}.worst_mode"),
    ),
    hidden("last", "Last mode compared", "count", source="all.last"),
    Column("converged", "Fits converged", "percent"),
    Column("fit_seconds", "Fits", "seconds"),
    Column("solve_seconds", "Modes", "seconds"),
)
def errors(study: Objectives) -> Iterator[Row]:
    """Relative errors of the frequencies against SLEPc on the fine mesh: root mean square, mean and
    worst, the last two positive if too high. Times are wall seconds on one core with other jobs
    beside it: of the fits, equal blocks once, with what each void pattern needs once, and of the
    coarse model’s modes by SLEPc."""
    for case, rating in study.ratings.items():
        for row in rating["rows"]:
            yield {**rating, **row, **study.identity(case)}


@table(
    Column("title", "Solid"),
    Column("cases", "Cases", "count"),
    Column("forest_rms", "Forests, rms", "percent"),
    Column("fit_rms", "Fit, rms", "percent"),
    Column("median", "Forests over fit, median", "percent"),
    Column("worst", "largest", "percent"),
    Column("where", "at"),
)
def forest(study: Objectives) -> Iterator[Row]:
    """The forests against the fit that they learned, block by block: rms errors of modes
    7–{last[audible]} against SLEPc on the fine mesh, pooled over a solid’s resolutions and
    materials, and the ratio of both, case by case."""
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
    case_columns(),
    Column("unknowns", "Unknowns", "count", source="n_dofs"),
    Column("coarse_unknowns", "coarsened", "count", source="coarse_n_dofs"),
    Column("blocks", "Blocks", "count"),
    Column("distinct_blocks", "distinct", "count"),
    Column("modes", "Modes", "count"),
    Column("inertia", "Found / counted"),
    Column("residual_max", "Largest residual", "small"),
    Column("orthogonality", "|XᵀMX − I|", "small"),
    Column("seconds", "Time", "seconds"),
)
def truths(study: Objectives) -> Iterator[Row]:
    """Ground truth of every case by SLEPc on the fine mesh: eigenvalues found below a shift μ, and
    counted there by the inertia of K − μM; wall seconds on one core."""
    return truths_of(study)


@table(
    Column("coarsening", "Objective"),
    Column("description", "What it is"),
)
def objectives(study: Objectives) -> Iterable[Row]:
    """What is fitted, block by block; the last two coarsen without a fit."""
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
    first = (inspect.getdoc(module_of(coarsening)) or "").split("\n", 1)[0]
    text = first.removeprefix(f"Objective `{coarsening}`:").replace("`", "").strip()
    return text[:1].upper() + text[1:]


@table(
    Column("material", "Material"),
    Column("description", "What it is"),
)
def materials(study: Objectives) -> Iterable[Row]:
    """Young’s modulus from voxel to voxel; Poisson’s ratio and density are the same everywhere."""
    return [{"material": name, "description": MATERIALS[name]} for name in study.part["materials"]]
