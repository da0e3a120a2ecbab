"""The columns that say which solid a row is about, and how large it is."""

from __future__ import annotations

from typing import Any

from workflow.report.results import Results
from workflow.report.table import Column
from workflow.variants import TRUTH

IDENTITY = (
    Column("model", "Model", shown=False),
    Column("title", "Solid"),
    Column("unknowns", "Unknowns", "count"),
    Column("coarse_unknowns", "coarsened", "count"),
)


def identity(results: Results, model: str) -> dict[str, Any]:
    """Values of the `IDENTITY` columns."""
    spectra = results.spectra[model]
    return {
        "model": model,
        "title": results.title(model),
        "unknowns": spectra[TRUTH].mesh.n_dofs,
        "coarse_unknowns": spectra["ddfem_hcms_ec"].mesh.n_dofs,
    }
