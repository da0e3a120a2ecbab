"""Tables of the study: errors of every case, modes that are far off, elements to blame."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy.stats

from studies.base.cases import ALL, CASE_COLUMNS, Case, error_columns, truths_of
from studies.base.conditions import NOT_TIMED, ONE_COLD_RUN, measured
from studies.base.numbers import show
from studies.base.table import Column, Row, hidden, table
from studies.coarsening.results import MODELS as MODELS
from studies.coarsening.results import CoarseningStudy

FIRST = 7
LABELS = {"plain": "Coarse", "refined": "Refined"}
KINDS = ("by_index", "recognised", "expected")
VERDICTS = ("swap", "local", "error")
METHODS = {"auto": "Default method", "slepc": "SLEPc"}


UNTIMED, ONE_RUN = (
    measured(lambda study: study.records, NOT_TIMED),
    measured(lambda study: study.records, ONE_COLD_RUN),
)


@table(
    lambda study: (
        f"""Relative errors of the frequencies of modes {FIRST}–{study.last} against SLEPc on
        the fine mesh, modes matched by index, of the coarse model and of the one taken instead:
        root mean square over all cases, each weighing the same, and the worst single frequency,
        negative if too low; how many modes are more than
        {show(study.goals["far_off"], "percent")} off, and why; and in how many cases the rms is
        at most {show(study.goals["rms"], "percent")} and the worst at most
        {show(study.goals["worst"], "percent")}."""
    ),
    lambda study: [
        Column("model", "Model"),
        *error_columns(study.part["materials"]),
        Column("far_off", "Modes far off", "count"),
        Column("swap", "swapped", "count"),
        Column("local", "local", "count"),
        Column("error", "in error", "count"),
        Column("met", "Cases within both goals", "count"),
        Column("cases", "of", "count"),
    ],
    conditions=UNTIMED,
)
def summary(study: CoarseningStudy) -> Iterator[Row]:
    """Errors of both models over all cases, by material."""
    for model in MODELS:
        row: Row = {"model": LABELS[model]}
        for material in (*study.part["materials"], ALL):
            cases = [case for case in study.ratings if material in (case.material, ALL)]
            row |= {
                f"{material}_{key}": value for key, value in _pooled(study, cases, model).items()
            }
        far = [mode["verdict"] for _, mode in study.far_off(model)]
        met = sum(study.meets_goals(case, model) for case in study.ratings)
        yield {
            **row,
            **{verdict: far.count(verdict) for verdict in VERDICTS},
            "far_off": len(far),
            "met": met,
            "cases": len(study.ratings),
        }


def _pooled(study: CoarseningStudy, cases: list[Case], model: str) -> Row:
    errors = {case: study.errors(case, model) for case in cases}
    worst = max(cases, key=lambda case: abs(errors[case]["worst"]))
    return {
        "rms": float(np.sqrt(np.mean([each["rms"] ** 2 for each in errors.values()]))),
        "worst": errors[worst]["worst"],
        "where": f"{study.label(worst)}, mode {errors[worst]['worst_mode']}",
    }


@table(
    lambda study: (
        f"""Unknowns, and relative errors of the frequencies of modes {FIRST}–{study.last}
        against SLEPc on the fine mesh, of the coarse model and of the refined one, whose worst
        blocks stay fine: modes matched by index, rms and worst; expected by two inverse
        iterations, without the truth, rms and worst; and by shape, as far as a coarse mode
        overlaps the exact one by 0.5 or more: how many do, rms and worst."""
    ),
    [
        hidden("model", "Model"),
        Column("title", "Solid"),
        hidden("resolution", "Resolution", "count"),
        Column("material", "Material"),
        Column("unknowns", "Unknowns, fine", "count", source="n_dofs"),
        *(
            column
            for model in MODELS
            for column in (
                Column(f"{model}_unknowns", f"{LABELS[model]}", "count", source=f"{model}.n_dofs"),
            )
        ),
        *(
            column
            for model in MODELS
            for column in (
                Column(
                    f"{model}_rms",
                    f"{LABELS[model]}, rms",
                    "percent",
                    source=f"{model}.by_index.rms",
                ),
                Column(f"{model}_worst", "worst", "percent", source=f"{model}.by_index.worst"),
                hidden(
                    f"{model}_worst_mode", "at mode", "count", source=f"{model}.by_index.worst_mode"
                ),
                Column(
                    f"{model}_expected_rms", "expected", "percent", source=f"{model}.expected.rms"
                ),
                Column(
                    f"{model}_expected_worst", "worst", "percent", source=f"{model}.expected.worst"
                ),
                hidden(
                    f"{model}_expected_mode",
                    "at mode",
                    "count",
                    source=f"{model}.expected.worst_mode",
                ),
            )
        ),
        *(
            column
            for model in MODELS
            for column in (
                Column(
                    f"{model}_shape_modes",
                    f"{LABELS[model]}, by shape",
                    "count",
                    source=f"{model}.recognised.modes",
                ),
                Column(f"{model}_shape_rms", "rms", "percent", source=f"{model}.recognised.rms"),
                Column(
                    f"{model}_shape_worst", "worst", "percent", source=f"{model}.recognised.worst"
                ),
                hidden(
                    f"{model}_shape_mode",
                    "at mode",
                    "count",
                    source=f"{model}.recognised.worst_mode",
                ),
                hidden(
                    f"{model}_forced_rms",
                    "All by shape, rms",
                    "percent",
                    source=f"{model}.by_projection.rms",
                ),
                hidden(
                    f"{model}_forced_worst",
                    "worst",
                    "percent",
                    source=f"{model}.by_projection.worst",
                ),
                hidden(
                    f"{model}_correlation",
                    "Rank correlation, mode by mode",
                    "score",
                    source=f"{model}.rank_correlation",
                ),
                hidden(f"{model}_far_off", "Modes far off", "count"),
                hidden(f"{model}_met", "Within both goals"),
            )
        ),
    ],
    keys="model resolution material",
    conditions=UNTIMED,
)
def cases(study: CoarseningStudy) -> Iterator[Row]:
    """Errors of both models of every case, true and expected."""
    for case, rating in study.ratings.items():
        row = {**rating, **study.identity(case)}
        for model in MODELS:
            row[f"{model}_met"] = study.meets_goals(case, model)
            row[f"{model}_far_off"] = len(rating[model]["far_off"])
        yield row


@table(
    """Processor seconds with other jobs beside it, without meshing and material: of the fine
    modes, and of what `--coarsen` costs in all (the coarse model, its estimate, and a refined
    model or the fine solid after that), how many times as fast that is, and which model is
    taken. By the default method, the least of three runs; by SLEPc, one run. Fine blocks are
    those of the model that SLEPc's run takes. Correlations are those of expected and true
    errors by ranks, mode by mode.""",
    [
        *CASE_COLUMNS,
        Column("cells", "Voxels", "count"),
        Column("blocks", "Elements", "count", source="plain.elements"),
        Column("fine_blocks", "Fine blocks", "count", source="refined.fine_blocks"),
        *(
            column
            for method in METHODS
            for column in (
                Column(
                    f"{method}_fine",
                    f"{METHODS[method]}, fine",
                    "seconds",
                    source=f"costs.{method}.fine.processor_seconds",
                ),
                Column(
                    f"{method}_coarse",
                    "with coarse",
                    "seconds",
                    source=f"costs.{method}.coarse.processor_seconds",
                ),
                Column(
                    f"{method}_faster", "times as fast", "times", source=f"costs.{method}.faster"
                ),
                Column(f"{method}_taken", "taken", source=f"costs.{method}.taken"),
                hidden(
                    f"{method}_fine_seconds",
                    "fine, wall",
                    "seconds",
                    source=f"costs.{method}.fine.seconds",
                ),
                hidden(
                    f"{method}_coarse_seconds",
                    "with coarse, wall",
                    "seconds",
                    source=f"costs.{method}.coarse.seconds",
                ),
                hidden(
                    f"{method}_estimates", "estimates", "count", source=f"costs.{method}.estimates"
                ),
                hidden(f"{method}_modes", "modes", "count", source=f"costs.{method}.modes"),
                hidden(f"{method}_reason", "reason", source=f"costs.{method}.reason"),
            )
        ),
        *(
            column
            for model in MODELS
            for column in (
                Column(
                    f"{model}_correlation",
                    f"Correlation, {LABELS[model].lower()}",
                    "score",
                    source=f"{model}.rank_correlation",
                ),
            )
        ),
    ],
    keys="model resolution material",
    conditions=ONE_RUN,
)
def costs(study: CoarseningStudy) -> Iterator[Row]:
    """What coarse models cost beside the fine solid, and what is taken, in every case."""
    for case, rating in study.ratings.items():
        yield {**rating, **study.identity(case)}


def speeds(study: CoarseningStudy, method: str) -> dict[str, float]:
    """How many times as fast as the fine solid coarse models are: median, least, most."""
    ratios = [rating["costs"][method]["faster"] for rating in study.ratings.values()]
    return {
        "median": float(np.median(ratios)),
        "least": float(min(ratios)),
        "most": float(max(ratios)),
    }


@table(
    lambda study: (
        f"""Modes more than {show(study.goals["far_off"], "percent")} off by their number. A
        swapped one is there under another number and within
        {show(study.goals["far_off"], "percent")} then; to a local one no coarse mode is
        similar, since it lives in few voxels that the coarse mesh does not resolve; the others
        are there, or parts of them, at a wrong frequency. The partner is the coarse mode of the
        most similar shape, no two modes having the same; half of the strain energy of a mode is
        in the share of voxels named last."""
    ),
    [
        hidden("model", "Model"),
        hidden("title", "Solid"),
        hidden("resolution", "Resolution", "count"),
        Column("material", "Material"),
        Column("of", "Model"),
        Column("mode", "Mode", "count"),
        Column("verdict", "Verdict"),
        Column("exact_hz", "Exact [Hz]", "hertz", "Hz"),
        Column("coarse_hz", "Coarse [Hz]", "hertz", "Hz"),
        Column("error", "Error", "percent"),
        Column("expected_error", "Expected", "percent"),
        Column("partner", "Partner", "count"),
        Column("overlap", "Overlap", "score"),
        hidden("largest_overlap", "Largest overlap", "score"),
        Column("matched_error", "Its error", "percent"),
        Column("half_of_energy", "Half of the energy in", "share"),
    ],
    keys="model resolution material of mode",
    conditions=UNTIMED,
)
def modes(study: CoarseningStudy) -> Iterator[Row]:
    """All modes that are far off by their number, in both models."""
    for model in MODELS:
        for case, mode in study.far_off(model):
            yield {**mode, **study.identity(case), "of": LABELS[model]}


@table(
    """The elements whose strain energy in the mode is farthest from that of their voxels:
    middle of their voxels, which of the eight are filled (x runs fastest, then y; the two
    layers apart), share of the mode’s strain energy, share of all that is missed or too much,
    and how much that is of the mode’s energy, positive where the element is too stiff.""",
    [
        hidden("model", "Model"),
        hidden("title", "Solid"),
        hidden("resolution", "Resolution", "count"),
        hidden("material", "Material"),
        hidden("of", "Model"),
        hidden("mode", "Mode", "count"),
        hidden("rank", "Rank", "count"),
        Column("x", "x [m]", "score", "m"),
        Column("y", "y [m]", "score", "m"),
        Column("z", "z [m]", "score", "m"),
        Column("pattern", "Voxels"),
        hidden("cells", "filled", "count"),
        Column("energy", "Energy", "share"),
        Column("blame", "Blame", "share"),
        Column("share", "Error", "share"),
    ],
    keys="model resolution material of mode rank",
    conditions=UNTIMED,
)
def elements(study: CoarseningStudy) -> Iterator[Row]:
    """The elements to blame for each of these modes."""
    for model in MODELS:
        for case, mode in study.far_off(model):
            for rank, element in enumerate(mode["elements"], start=1):
                place = dict(zip("xyz", element["place"], strict=True))
                about = {"of": LABELS[model], "mode": mode["mode"], "rank": rank}
                pattern = {"pattern": filled_cells(element["pattern"])}
                yield {**element, **study.identity(case), **about, **place, **pattern}


def filled_cells(pattern: int) -> str:
    """The bits of a pattern as marks, cell x + 2 y + 4 z after cell, the two layers apart.

    Examples
    --------
    >>> filled_cells(0b00010111)
    '●●●○ ●○○○'
    """
    marks = "".join("●" if pattern >> cell & 1 else "○" for cell in range(8))
    return f"{marks[:4]} {marks[4:]}"


@table(
    """Ground truth of every case by SLEPc on the fine mesh: eigenvalues found below a shift μ,
    and counted there by the inertia of K − μM.""",
    [
        *CASE_COLUMNS,
        Column("unknowns", "Unknowns", "count", source="n_dofs"),
        Column("inertia", "Found / counted"),
        Column("residual_max", "Largest residual", "small"),
        Column("orthogonality", "|XᵀMX − I|", "small"),
        Column("seconds", "Time", "seconds"),
    ],
    keys="model resolution material",
    conditions=ONE_RUN,
)
def truths(study: CoarseningStudy) -> Iterator[Row]:
    """Size and proof of every ground truth."""
    return truths_of(study)


def rank_correlation(study: CoarseningStudy) -> float | None:
    """Spearman's rank correlation of expected and true rms errors, over cases and models."""
    pairs = [
        [study.errors(case, model, kind)["rms"] for kind in ("expected", "by_index")]
        for case in study.ratings
        for model in MODELS
    ]
    expected, true = np.array(pairs).T
    if min(np.ptp(expected), np.ptp(true)) == 0.0:
        return None
    return float(scipy.stats.spearmanr(expected, true).statistic)
