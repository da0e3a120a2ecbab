"""Which tables Snakemake's own report offers, and what it says of them.

Everything else is marked in the rules themselves, each with a caption in `captions/`.
"""

from __future__ import annotations

from collections.abc import Iterable

from snakemake.io import report

SHOWS = {
    "summary": "The main numbers",
    "summary-all": "Errors over all modes",
    "frequencies": "Natural frequencies, mode by mode",
    "errors": "Distance from SLEPc on the fine mesh",
    "coarsening": "Error of each coarsening alone",
    "times": "Wall times of one cold run",
    "methods": "Wall times, median of alternating runs",
    "spreads": "Wall times with least and greatest",
    "ratios": "Speed-ups, each with its base",
    "convergence": "Eigenvalue errors by correction",
    "scaling": "Wall times over MPI ranks",
    "phases": "Wall times by phase",
    "training": "Training data and held-out scores",
    "model": "Size and held-out scores of the forests",
    "blocks": "Errors and costs on single blocks",
    "every-block": "Errors and costs by kind of blocks",
    "variants": "Scores of other ways to train",
    "curve": "Scores over the rows trained on",
    "cost": "Wall time of a block",
    "sizes": "Wall time over the size of forests",
    "goals": "Goals met and missed",
    "goal-cases": "Goals, case by case",
    "forest": "The forests against their fit",
    "truths": "Ground truth of every case",
    "objectives": "What each objective is",
    "materials": "What each material is",
    "evidence": "Residuals, orthogonality, counts of modes",
    "provenance": "Origin of every result file",
}
"""What a table is about, by its name, short enough for a list."""
CAPTION = "../report/captions/table.rst"
"""Seen from the folder of the rules."""


def tables(folder: str, names: Iterable[str], target: str) -> list[str]:
    """Files of the tables in `folder`, the CSV files marked for the report.

    Parameters
    ----------
    folder : folder of the tables.
    names : names of the tables.
    target : what the report lists them under: the target that makes them.
    """
    return [part for name in names for part in _files(f"{folder}/{name}", name, target)]


def _files(stem: str, name: str, target: str) -> list[str]:
    csv = report(
        f"{stem}.csv",
        caption=CAPTION,
        category="Tables",
        subcategory=target,
        labels={"table": name, "shows": SHOWS[name]},
    )
    return [csv, f"{stem}.md", f"{stem}.json"]
