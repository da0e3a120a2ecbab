"""Tables of the figures beside those that are a run's, too."""

from __future__ import annotations

from workflow.studies.base.entry import Row
from workflow.studies.base.provenance import rows_of
from workflow.studies.figures.results import Figures


def provenance(figures: Figures) -> list[Row]:
    """Origin of every result file."""
    return rows_of(
        {
            f"models/{model}/{part}.json": found["provenance"]
            for part in ("methods", "convergence", "scaling")
            for model, found in getattr(figures, part).items()
        }
    )
