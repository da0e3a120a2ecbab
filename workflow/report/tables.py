"""All tables of a run, by name."""

from __future__ import annotations

from collections.abc import Callable

from workflow.report import (
    convergence_tables,
    evidence_tables,
    forests_tables,
    methods_tables,
    spectra_tables,
    times_tables,
)
from workflow.report.results import Results
from workflow.report.table import Table

BUILDERS: dict[str, Callable[[Results], Table]] = {
    "summary": spectra_tables.summary,
    "frequencies": spectra_tables.frequencies,
    "errors": spectra_tables.errors,
    "coarsening": spectra_tables.coarsening,
    "times": times_tables.times,
    "methods": lambda results: methods_tables.methods(results.methods, results.titles),
    "ratios": lambda results: methods_tables.ratios(results.methods, results.titles),
    "convergence": lambda results: convergence_tables.convergence(
        results.convergence, results.titles
    ),
    "phases": times_tables.phases,
    "training": forests_tables.training,
    "blocks": forests_tables.blocks,
    "evidence": evidence_tables.evidence,
    "provenance": evidence_tables.provenance,
}


def build_tables(results: Results) -> list[Table]:
    """Build every table of a run."""
    return [build(results) for build in BUILDERS.values()]
