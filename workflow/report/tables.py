"""All tables of a run, by name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from workflow.report import (
    blocks_tables,
    evidence_tables,
    forests_tables,
    measured_tables,
    spectra_tables,
    times_tables,
)
from workflow.report.conditions import NOT_TIMED, ONE_COLD_RUN, Repeats, conditions
from workflow.report.results import Results
from workflow.report.table import Table

Builder = Callable[[Results], Table]


def of_spectra(build: Builder, repeats: Repeats = NOT_TIMED) -> Builder:
    """The builder of a table about the modes files, with the conditions that they were made in."""

    def built(results: Results) -> Table:
        records = {
            f"{model} {variant}": spectrum.provenance
            for model, spectra in results.spectra.items()
            for variant, spectrum in spectra.items()
        }
        told = conditions(records, results.config, repeats)
        return replace(build(results), conditions=told)

    return built


def blocks(results: Results) -> Table:
    """Error, cost and storage on single blocks, as in Fig. 9 of the paper."""
    repeats = blocks_tables.repeats(results.blocks)
    told = conditions({"all": results.blocks_record}, results.config, repeats)
    return replace(blocks_tables.overview(results.blocks), conditions=told)


BUILDERS: dict[str, Builder] = {
    "summary": of_spectra(spectra_tables.summary, ONE_COLD_RUN),
    "frequencies": of_spectra(spectra_tables.frequencies),
    "errors": of_spectra(spectra_tables.errors),
    "coarsening": of_spectra(spectra_tables.coarsening),
    "times": of_spectra(times_tables.times, ONE_COLD_RUN),
    "methods": measured_tables.methods,
    "spreads": measured_tables.spreads,
    "ratios": measured_tables.ratios,
    "convergence": measured_tables.convergence,
    "scaling": measured_tables.scaling,
    "phases": of_spectra(times_tables.phases, ONE_COLD_RUN),
    "training": forests_tables.training,
    "blocks": blocks,
    "evidence": of_spectra(evidence_tables.evidence),
    "provenance": evidence_tables.provenance,
}


def build_tables(results: Results) -> list[Table]:
    """Build every table of a run."""
    return [build(results) for build in BUILDERS.values()]
