"""Tables of the figures, by name."""

from __future__ import annotations

from collections.abc import Callable

from workflow.figures.results import Figures
from workflow.report.evidence_tables import provenance_table
from workflow.report.measured_tables import convergence, methods, ratios, scaling, spreads
from workflow.report.table import Table


def provenance(figures: Figures) -> Table:
    """Command, code and machine behind every result."""
    parts = {
        "methods": figures.methods,
        "convergence": figures.convergence,
        "scaling": figures.scaling,
    }
    return provenance_table(
        {
            f"models/{model}/{part}.json": found["provenance"]
            for part, by_model in parts.items()
            for model, found in by_model.items()
        }
    )


BUILDERS: dict[str, Callable[[Figures], Table]] = {
    "methods": methods,
    "spreads": spreads,
    "ratios": ratios,
    "convergence": convergence,
    "scaling": scaling,
    "provenance": provenance,
}


def build_tables(figures: Figures) -> list[Table]:
    """Build every table of the figures."""
    return [build(figures) for build in BUILDERS.values()]
