"""What the tables say, in the few numbers that a reader wants first."""

from typing import Any

import pandas as pd

from studies.base.table import Table
from workflow.report.design_tables import QUANTITIES, costs, spread_of
from workflow.report.results import FAST

PROVEN_RESIDUAL = 1e-6
"""Residual that ground truth must stay below for the page to call it proven."""


def findings(tables: dict[str, Table], refine_to: float | None = None) -> dict[str, Any]:
    """Headline numbers over all models, from the tables of a run."""
    summary, coarsening, times, evidence, frequencies = (
        _frame(tables[name])
        for name in ("summary", "coarsening", "times", "evidence", "frequencies")
    )
    truths = evidence.dropna(subset="inertia")
    counts = truths["inertia"].str.split(" / ", expand=True)
    residual = truths["residual_max"].max()
    coarsened = coarsening[coarsening[f"{FAST}_rms"].notna()]
    were = times["model"].isin(coarsened["model"])
    return {
        # Number of models that were: not finite cells, nor where the fine solid was solved instead.
        "coarsened": len(coarsened),
        # Worst eigenvalue of any model; rms frequency errors of the coarsened mesh.
        "hcms_error": summary["hcms_error"].max(),
        "hcms_ec_error": summary["hcms_ec_error"].max(),
        "ddfem_error": _median(summary["ddfem_error"]),
        "ddfem_errors": (summary["ddfem_error"].min(), summary["ddfem_error"].max()),
        "average_error": _median(coarsened["average_hcms_ec_rms"]),
        "galerkin_error": _median(coarsened["galerkin_hcms_ec_rms"]),
        # Of the solve of a design: median, least and greatest over the solids, or None.
        "design": {key: spread_of(tables["design"], key) for key in QUANTITIES},
        "costs": costs(tables, refine_to),
        # SLEPc's time over that of HCMS + EC on the same mesh.
        "fine_ratio": _median(times["truth"] / times["hcms_ec"]),
        "coarse_ratio": _median((times["ddfem_slepc"] / times[FAST])[were]),
        "proven": residual < PROVEN_RESIDUAL and (counts[0] == counts[1]).all(),
        "residual": residual,
        "elastic_modes": len(frequencies),
        "unknowns": (summary["unknowns"].min(), summary["unknowns"].max()),
    }


def missed(evidence: Table, tolerance: float) -> list[dict[str, Any]]:
    """Rows of the runs whose correction came no nearer than this, by their own estimate."""
    return [row for row in evidence.rows if (row.get("estimate") or 0.0) > tolerance]


def _frame(table: Table) -> pd.DataFrame:
    """A table with all of its columns; what rows lack is no number."""
    frame = pd.DataFrame(table.rows, columns=[column.key for column in table.columns])
    numbers = [column.key for column in table.columns if column.kind != "text"]
    return frame.astype(dict.fromkeys(numbers, float))


def _median(values: pd.Series) -> float:
    """Median of the numbers among values, no number if there are none."""
    return float(values.dropna().median())


def headline(count: int, missed: int) -> str:
    """How many of the criteria are met."""
    if missed == 0:
        return f"Passed: all {count} criteria are met."
    return f"Failed: {missed} of {count} criteria {'is' if missed == 1 else 'are'} missed."
