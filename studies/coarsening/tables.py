"""Tables of the study: errors of every case, modes that are far off, elements to blame."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy.stats

from studies.base.cases import Case
from studies.base.conditions import NOT_TIMED, ONE_COLD_RUN, Record, measured
from studies.base.entry import Row
from studies.coarsening.results import MODELS as MODELS
from studies.coarsening.results import CoarseningStudy

FIRST = 7
ALL = "all"
"""Stands for every material in the pooled table."""
LABELS = {"plain": "Coarse", "refined": "Refined"}
KINDS = ("by_index", "recognised", "expected")
VERDICTS = ("swap", "local", "error")
METHODS = {"auto": "Default method", "slepc": "SLEPc"}


def _records(study: CoarseningStudy) -> dict[str, Record]:
    return {study.label(case): rating["provenance"] for case, rating in study.ratings.items()}


UNTIMED, ONE_RUN = measured(_records, NOT_TIMED), measured(_records, ONE_COLD_RUN)


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


def cases(study: CoarseningStudy) -> Iterator[Row]:
    """Errors of both models of every case, true and expected."""
    for case, rating in study.ratings.items():
        row = {**rating, **study.identity(case)}
        for model in MODELS:
            row[f"{model}_met"] = study.meets_goals(case, model)
            row[f"{model}_far_off"] = len(rating[model]["far_off"])
        yield row


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


def modes(study: CoarseningStudy) -> Iterator[Row]:
    """All modes that are far off by their number, in both models."""
    for model in MODELS:
        for case, mode in study.far_off(model):
            yield {**mode, **study.identity(case), "of": LABELS[model]}


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


def truths(study: CoarseningStudy) -> Iterator[Row]:
    """Size and proof of every ground truth."""
    for case, rating in study.ratings.items():
        truth = rating["truth"]
        counted = "inertia_count" in truth
        proof = f"{truth['inertia_expected']} / {truth['inertia_count']}" if counted else None
        yield {**rating, **truth, **study.identity(case), "inertia": proof}


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
