"""Tables of frequencies and of their errors against the ground truth."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from carillon.fem.model import RIGID_MODES
from solver.studies.comparison import AUDIBLE_FIRST, AUDIBLE_LAST
from workflow.report.identity import IDENTITY, identity
from workflow.report.results import Results
from workflow.report.table import Column, Table
from workflow.report.times_tables import solve_seconds
from workflow.variants import CANDIDATES, COARSENED, SHOWN, TRUTH, VARIANTS

AUDIBLE = f"modes {AUDIBLE_FIRST}–{AUDIBLE_LAST}"


def summary(results: Results) -> Table:
    """One row a model: size, accuracy, time."""
    return Table(
        "summary",
        "Every solid at a glance. Eigenvalue errors are relative to SLEPc on the fine mesh over "
        "all elastic modes; frequency errors of the coarsened mesh are root mean squares over "
        f"{AUDIBLE}. Times are wall seconds from the moduli to the modes; the speed-up's base is "
        "SLEPc.",
        [
            *IDENTITY,
            Column("modes", "Modes", "count"),
            Column("hcms_error", "HCMS, worst eigenvalue", "percent"),
            Column("hcms_ec_error", "HCMS + EC, worst eigenvalue", "percent"),
            Column("ddfem_error", "DDFEM* + HCMS + EC, frequencies", "percent"),
            Column("truth_seconds", "SLEPc", "seconds", "s"),
            Column("fast_seconds", "DDFEM* + HCMS + EC", "seconds", "s"),
            Column("speed_up", "Speed-up", "times"),
        ],
        [_summary_row(results, model) for model in results.models],
    )


def _summary_row(results: Results, model: str) -> dict[str, Any]:
    spectra, comparisons = results.spectra[model], results.comparisons[model]
    truth, fast = (solve_seconds(spectra[variant]) for variant in (TRUTH, "ddfem_hcms_ec"))
    return identity(results, model) | {
        "modes": len(spectra[TRUTH].eigenvalues),
        "hcms_error": comparisons["hcms"]["eigenvalue_relative_error"]["max"],
        "hcms_ec_error": comparisons["hcms_ec"]["eigenvalue_relative_error"]["max"],
        "ddfem_error": comparisons["ddfem_hcms_ec"]["frequency_rms_relative_error_7_60"],
        "truth_seconds": truth,
        "fast_seconds": fast,
        "speed_up": truth / fast,
    }


def frequencies(results: Results) -> Table:
    """Frequency of every elastic mode by the variants that are shown, and its error."""
    columns = [Column("model", "Solid"), Column("mode", "Mode", "count")]
    columns.append(Column(TRUTH, VARIANTS[TRUTH].label, "hertz", "Hz"))
    for variant in SHOWN[1:]:
        columns.append(Column(variant, VARIANTS[variant].label, "hertz", "Hz"))
        columns.append(Column(f"{variant}_error", "error", "percent"))
    return Table(
        "frequencies",
        "Natural frequencies [Hz] from the first elastic mode on, and their relative errors "
        "against SLEPc on the fine mesh.",
        columns,
        [row for model in results.models for row in _frequency_rows(results, model)],
        ["model", "mode"],
    )


def _frequency_rows(results: Results, model: str) -> Iterator[dict[str, Any]]:
    spectra = results.spectra[model]
    count = min(len(spectra[variant].frequencies) for variant in SHOWN)
    for index in range(RIGID_MODES, count):
        truth = float(spectra[TRUTH].frequencies[index])
        row: dict[str, Any] = {"model": model, "mode": index + 1, TRUTH: truth}
        for variant in SHOWN[1:]:
            row[variant] = float(spectra[variant].frequencies[index])
            row[f"{variant}_error"] = row[variant] / truth - 1.0
        yield row


def errors(results: Results) -> Table:
    """Distances of every variant from the truth."""
    return Table(
        "errors",
        "Distance from SLEPc on the fine mesh: relative errors of eigenvalues over all elastic "
        f"modes, of frequencies over {AUDIBLE}, and the largest mass-weighted angle between the "
        "spaces of modes, clusters taken together; 90° means that modes changed places.",
        [
            Column("model", "Solid"),
            Column("variant", "Method"),
            Column("median", "Eigenvalue, median", "percent"),
            Column("p90", "90 % below", "percent"),
            Column("max", "worst", "percent"),
            Column("rms_7_60", "Frequency, rms", "percent"),
            Column("max_7_60", "worst", "percent"),
            Column("angle", "Largest angle", "angle", "rad"),
            Column("compared", "Modes compared", "count"),
        ],
        [
            {
                "model": model,
                "variant": VARIANTS[variant].label,
                **comparison["eigenvalue_relative_error"],
                "rms_7_60": comparison["frequency_rms_relative_error_7_60"],
                "max_7_60": comparison["frequency_max_relative_error_7_60"],
                "angle": comparison["subspace_angle_max"],
                "compared": comparison["modes_compared"],
            }
            for model in results.models
            for variant, comparison in results.comparisons[model].items()
            if variant in CANDIDATES
        ],
        ["model", "variant"],
    )


def coarsening(results: Results) -> Table:
    """What the coarsening alone costs in accuracy."""
    columns = [*IDENTITY]
    for variant, label in COARSENED.items():
        columns.append(Column(f"{variant}_rms", f"{label}, rms", "percent"))
        columns.append(Column(f"{variant}_max", "worst", "percent"))
    return Table(
        "coarsening",
        f"Relative errors of the frequencies of {AUDIBLE} after coarsening 2×2×2 voxels to one "
        "cell, against SLEPc on the fine mesh. All three solve the coarsened model by HCMS + EC.",
        columns,
        [_coarsening_row(results, model) for model in results.models],
    )


def _coarsening_row(results: Results, model: str) -> dict[str, Any]:
    row = identity(results, model)
    for variant in COARSENED:
        comparison = results.comparisons[model][variant]
        row[f"{variant}_rms"] = comparison["frequency_rms_relative_error_7_60"]
        row[f"{variant}_max"] = comparison["frequency_max_relative_error_7_60"]
    return row
