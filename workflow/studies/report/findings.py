"""What the tables say, in the few numbers that a reader wants first."""

from __future__ import annotations

import statistics
from dataclasses import dataclass
from typing import Any

from workflow.studies.base.table import Table

PROVEN_RESIDUAL = 1e-6
"""Residual that ground truth must stay below for the page to call it proven."""


@dataclass(frozen=True)
class Findings:
    """Headline numbers over all models.

    Attributes
    ----------
    hcms_error, hcms_ec_error
        Worst relative eigenvalue error of any model without and with error correction.
    ddfem_error, ddfem_errors
        Median over the models, and range, of the coarsened mesh's rms frequency error.
    average_error, galerkin_error
        The same median for the other coarsenings.
    speed_up, speed_ups
        Median, smallest and largest ratio of SLEPc's time to that of DDFEM* + HCMS + EC.
    fine_ratio, coarse_ratio
        Median ratio of SLEPc's time to that of HCMS + EC, on the fine and on the coarsened mesh.
    faster
        Whether the fast method was faster than SLEPc on every model.
    proven
        Whether every ground truth passed its residual and inertia checks.
    residual, elastic_modes, unknowns
        Largest residual of a ground truth, elastic modes in all, smallest and largest model.
    """

    hcms_error: float
    hcms_ec_error: float
    ddfem_error: float
    ddfem_errors: tuple[float, float]
    average_error: float
    galerkin_error: float
    speed_up: float
    speed_ups: tuple[float, float]
    fine_ratio: float
    coarse_ratio: float
    faster: bool
    proven: bool
    residual: float
    elastic_modes: int
    unknowns: tuple[int, int]


def findings(tables: dict[str, Table]) -> Findings:
    """Reduce the tables of a run to its headline numbers."""
    summary, coarsening = tables["summary"].rows, tables["coarsening"].rows
    times = tables["times"].rows
    truths = [row for row in tables["evidence"].rows if row["inertia"] is not None]
    speed_ups = _all(summary, "speed_up")
    ddfem = _all(summary, "ddfem_error")
    residual = max(_all(truths, "residual_max"))
    return Findings(
        hcms_error=max(_all(summary, "hcms_error")),
        hcms_ec_error=max(_all(summary, "hcms_ec_error")),
        ddfem_error=statistics.median(ddfem),
        ddfem_errors=(min(ddfem), max(ddfem)),
        average_error=statistics.median(_all(coarsening, "average_hcms_ec_rms")),
        galerkin_error=statistics.median(_all(coarsening, "galerkin_hcms_ec_rms")),
        speed_up=statistics.median(speed_ups),
        speed_ups=(min(speed_ups), max(speed_ups)),
        fine_ratio=_median_ratio(times, "truth", "hcms_ec"),
        coarse_ratio=_median_ratio(times, "ddfem_slepc", "ddfem_hcms_ec"),
        faster=min(speed_ups) > 1.0,
        proven=residual < PROVEN_RESIDUAL and all(_counted(row) for row in truths),
        residual=residual,
        elastic_modes=len(tables["frequencies"].rows),
        unknowns=(min(_all(summary, "unknowns")), max(_all(summary, "unknowns"))),
    )


def _all(rows: list[dict[str, Any]], key: str) -> list[Any]:
    return [row[key] for row in rows]


def _median_ratio(rows: list[dict[str, Any]], above: str, below: str) -> float:
    return statistics.median(row[above] / row[below] for row in rows)


def _counted(row: dict[str, Any]) -> bool:
    found, counted = row["inertia"].split(" / ")
    return bool(found == counted)


def headline(count: int, missed: int) -> str:
    """How many of the criteria are met."""
    if missed == 0:
        return f"Passed: all {count} criteria are met."
    return f"Failed: {missed} of {count} criteria {'is' if missed == 1 else 'are'} missed."
