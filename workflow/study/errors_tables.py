"""Tables of frequency errors: pooled by objective and material, and case by case."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from carillon.fem.model import RIGID_MODES
from workflow.report.table import Column, Table
from workflow.study.cases import Case, Study
from workflow.study.identity import IDENTITY, identity, label

FIRST = RIGID_MODES + 1
ALL = "all"
"""Stands for every material in the pooled tables."""


def summary(study: Study) -> Table:
    """Errors of modes 7..60 by objective and material."""
    return _pooled(study, "summary", "audible", study.last_audible)


def summary_all(study: Study) -> Table:
    """Errors of all modes by objective and material."""
    return _pooled(study, "summary-all", "all", study.last)


def _pooled(study: Study, name: str, part: str, last: int) -> Table:
    columns = [Column("coarsening", "Objective")]
    for material in (*study.materials, ALL):
        columns.append(Column(f"{material}_rms", f"{material.capitalize()}, rms", "percent"))
        columns.append(Column(f"{material}_worst", "worst", "percent"))
        columns.append(Column(f"{material}_where", "at", shown=False))
    rows = [_pooled_row(study, coarsening, part) for coarsening in study.coarsenings]
    return Table(
        name,
        f"Relative errors of the frequencies of modes {FIRST}–{last} against SLEPc on the fine "
        "mesh, modes matched by index, by objective and material: root mean square over all "
        "solids and resolutions, each weighing the same, and the worst single frequency, negative "
        "if too low. The smallest rms over all materials comes first.",
        columns,
        sorted(rows, key=lambda row: row["all_rms"]),
    )


def _pooled_row(study: Study, coarsening: str, part: str) -> dict[str, Any]:
    row: dict[str, Any] = {"coarsening": coarsening}
    for material in (*study.materials, ALL):
        errors = {
            case: study.errors(case, coarsening)[part]
            for case in study.found
            if material in (case.material, ALL)
        }
        squares = [found["rms"] ** 2 for found in errors.values()]
        worst = max(errors, key=lambda case: abs(errors[case]["worst"]))
        row |= {
            f"{material}_rms": float(np.sqrt(np.mean(squares))),
            f"{material}_worst": errors[worst]["worst"],
            f"{material}_where": f"{label(study, worst)}, mode {errors[worst]['worst_mode']}",
        }
    return row


def errors(study: Study) -> Table:
    """Every coarsening of every case."""
    columns = [
        *IDENTITY,
        Column("unknowns", "Unknowns", "count"),
        Column("coarse_unknowns", "coarsened", "count"),
        Column("coarsening", "Objective"),
    ]
    for part, last in (("audible", study.last_audible), ("all", study.last)):
        columns.append(Column(f"{part}_rms", f"Modes {FIRST}–{last}, rms", "percent"))
        columns.append(Column(f"{part}_mean", "mean", "percent"))
        columns.append(Column(f"{part}_worst", "worst", "percent"))
        columns.append(Column(f"{part}_worst_mode", "at mode", "count"))
    columns += [
        Column("last", "Last mode compared", "count", shown=False),
        Column("converged", "Fits converged", "percent"),
        Column("fit_seconds", "Fits", "seconds", "s"),
        Column("solve_seconds", "Modes", "seconds", "s"),
    ]
    return Table(
        "errors",
        "Relative errors of the frequencies against SLEPc on the fine mesh: root mean square, mean "
        "and worst, the last two positive if too high. Times are wall seconds on one core with "
        "other jobs beside it: of the fits, equal blocks once, with what each void pattern needs "
        "once, and of the coarse model’s modes by SLEPc.",
        columns,
        [row for case in study.found for row in _error_rows(study, case)],
    )


def _error_rows(study: Study, case: Case) -> Iterator[dict[str, Any]]:
    found = study.found[case]
    for row in found["rows"]:
        yield {
            **identity(study, case),
            "unknowns": found["n_dofs"],
            "coarse_unknowns": found["coarse_n_dofs"],
            "last": row["all"]["last"],
            **{key: row[key] for key in ("coarsening", "converged")},
            **{key: row[key] for key in ("fit_seconds", "solve_seconds")},
            **{
                f"{part}_{key}": row[part][key]
                for part in ("audible", "all")
                for key in ("rms", "mean", "worst", "worst_mode")
            },
        }
