"""Tables of the study: errors of every case, modes that are far off, elements to blame."""

from collections.abc import Iterator

import numpy as np
import scipy.stats

from studies.base.cases import ONE_RUN, UNTIMED, case_columns, error_columns, pooled, truths_of
from studies.base.table import Column, Row, each, hidden, table
from studies.coarsening.results import MODELS as MODELS
from studies.coarsening.results import CoarseningStudy

LABELS = {"plain": "Coarse", "refined": "Refined"}
VERDICTS = ("swap", "local", "error")
METHODS = {"auto": "Default method", "slepc": "SLEPc"}


@table(
    Column("model", "Model"),
    lambda study: error_columns(study.part["materials"]),
    Column("far_off", "Modes far off", "count"),
    Column("swap", "swapped", "count"),
    Column("local", "local", "count"),
    Column("error", "in error", "count"),
    Column("met", "Cases within both goals", "count"),
    Column("cases", "of", "count"),
    conditions=UNTIMED,
)
def summary(study: CoarseningStudy) -> Iterator[Row]:
    """Relative errors of the frequencies of modes 7–{last} against SLEPc on the fine mesh, modes
    matched by index, of the coarse model and of the one taken instead: root mean square over all
    cases, each weighing the same, and the worst single frequency, negative if too low; how many
    modes are more than {goals[far_off]:percent} off, and why; and in how many cases the rms is at
    most {goals[rms]:percent} and the worst at most {goals[worst]:percent}."""
    for model in MODELS:
        errors = {case: study.errors(case, model) for case in study.ratings}
        far = [mode["verdict"] for _, mode in study.far_off(model)]
        met = sum(study.meets_goals(case, model) for case in study.ratings)
        yield {
            "model": LABELS[model],
            **pooled(study, errors),
            **{verdict: far.count(verdict) for verdict in VERDICTS},
            "far_off": len(far),
            "met": met,
            "cases": len(study.ratings),
        }


@table(
    case_columns("title material"),
    Column("unknowns", "Unknowns, fine", "count", source="n_dofs"),
    each(LABELS, Column("{name}_unknowns", "{label}", "count", source="{name}.n_dofs")),
    each(
        LABELS,
        Column("{name}_rms", "{label}, rms", "percent", source="{name}.by_index.rms"),
        Column("{name}_worst", "worst", "percent", source="{name}.by_index.worst"),
        hidden("{name}_worst_mode", "at mode", "count", source="{name}.by_index.worst_mode"),
        Column("{name}_expected_rms", "expected", "percent", source="{name}.expected.rms"),
        Column("{name}_expected_worst", "worst", "percent", source="{name}.expected.worst"),
        hidden("{name}_expected_mode", "at mode", "count", source="{name}.expected.worst_mode"),
    ),
    each(
        LABELS,
        Column(
            "{name}_shape_modes", "{label}, by shape", "count", source="{name}.recognised.modes"
        ),
        Column("{name}_shape_rms", "rms", "percent", source="{name}.recognised.rms"),
        Column("{name}_shape_worst", "worst", "percent", source="{name}.recognised.worst"),
        hidden("{name}_shape_mode", "at mode", "count", source="{name}.recognised.worst_mode"),
        hidden(
            "{name}_forced_rms", "All by shape, rms", "percent", source="{name}.by_projection.rms"
        ),
        hidden("{name}_forced_worst", "worst", "percent", source="{name}.by_projection.worst"),
        hidden(
            "{name}_correlation",
            "Rank correlation, mode by mode",
            "score",
            source="{name}.rank_correlation",
        ),
        hidden("{name}_far_off", "Modes far off", "count"),
        hidden("{name}_met", "Within both goals"),
    ),
    keys="model resolution material",
    conditions=UNTIMED,
)
def cases(study: CoarseningStudy) -> Iterator[Row]:
    """Unknowns, and relative errors of the frequencies of modes 7–{last} against SLEPc on the fine
    mesh, of the coarse model and of the refined one, whose worst blocks stay fine: modes matched by
    index, rms and worst; expected by two inverse iterations, without the truth, rms and worst; and
    by shape, as far as a coarse mode overlaps the exact one by 0.5 or more: how many do, rms and
    worst."""
    for case, rating in study.ratings.items():
        row = {**rating, **study.identity(case)}
        for model in MODELS:
            row[f"{model}_met"] = study.meets_goals(case, model)
            row[f"{model}_far_off"] = len(rating[model]["far_off"])
        yield row


@table(
    case_columns(),
    Column("cells", "Voxels", "count"),
    Column("blocks", "Elements", "count", source="plain.elements"),
    Column("fine_blocks", "Fine blocks", "count", source="refined.fine_blocks"),
    each(
        METHODS,
        Column(
            "{name}_fine", "{label}, fine", "seconds", source="costs.{name}.fine.processor_seconds"
        ),
        Column(
            "{name}_coarse",
            "with coarse",
            "seconds",
            source="costs.{name}.coarse.processor_seconds",
        ),
        Column("{name}_faster", "times as fast", "times", source="costs.{name}.faster"),
        Column("{name}_taken", "taken", source="costs.{name}.taken"),
        hidden("{name}_fine_seconds", "fine, wall", "seconds", source="costs.{name}.fine.seconds"),
        hidden(
            "{name}_coarse_seconds",
            "with coarse, wall",
            "seconds",
            source="costs.{name}.coarse.seconds",
        ),
        hidden("{name}_estimates", "estimates", "count", source="costs.{name}.estimates"),
        hidden("{name}_modes", "modes", "count", source="costs.{name}.modes"),
        hidden("{name}_reason", "reason", source="costs.{name}.reason"),
    ),
    each(
        {"plain": "coarse", "refined": "refined"},
        Column(
            "{name}_correlation", "Correlation, {label}", "score", source="{name}.rank_correlation"
        ),
    ),
    keys="model resolution material",
    conditions=ONE_RUN,
)
def costs(study: CoarseningStudy) -> Iterator[Row]:
    """Processor seconds with other jobs beside it, without meshing and material: of the fine modes,
    and of what `--coarsen` costs in all (the coarse model, its estimate, and a refined model or the
    fine solid after that), how many times as fast that is, and which model is taken. By the default
    method, the least of three runs; by SLEPc, one run. Fine blocks are those of the model that
    SLEPc's run takes. Correlations are those of expected and true errors by ranks, mode by mode."""
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
    case_columns("material"),
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
    keys="model resolution material of mode",
    conditions=UNTIMED,
)
def modes(study: CoarseningStudy) -> Iterator[Row]:
    """Modes more than {goals[far_off]:percent} off by their number. A swapped one is there under
    another number and within {goals[far_off]:percent} then; to a local one no coarse mode is
    similar, since it lives in few voxels that the coarse mesh does not resolve; the others are
    there, or parts of them, at a wrong frequency. The partner is the coarse mode of the most
    similar shape, no two modes having the same; half of the strain energy of a mode is in the share
    of voxels named last."""
    for model in MODELS:
        for case, mode in study.far_off(model):
            yield {**mode, **study.identity(case), "of": LABELS[model]}


@table(
    case_columns(""),
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
    keys="model resolution material of mode rank",
    conditions=UNTIMED,
)
def elements(study: CoarseningStudy) -> Iterator[Row]:
    """The elements whose strain energy in the mode is farthest from that of their voxels: middle of
    their voxels, which of the eight are filled (x runs fastest, then y; the two layers apart),
    share of the mode’s strain energy, share of all that is missed or too much, and how much that is
    of the mode’s energy, positive where the element is too stiff."""
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
    case_columns(),
    Column("unknowns", "Unknowns", "count", source="n_dofs"),
    Column("inertia", "Found / counted"),
    Column("residual_max", "Largest residual", "small"),
    Column("orthogonality", "|XᵀMX − I|", "small"),
    Column("seconds", "Time", "seconds"),
    keys="model resolution material",
    conditions=ONE_RUN,
)
def truths(study: CoarseningStudy) -> Iterator[Row]:
    """Ground truth of every case by SLEPc on the fine mesh: eigenvalues found below a shift μ, and
    counted there by the inertia of K − μM."""
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
