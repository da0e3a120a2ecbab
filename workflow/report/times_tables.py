"""Tables of wall times."""

from __future__ import annotations

from typing import Any

from solver.files.modes_file import CHECKS, ModesFile
from workflow.report.identity import IDENTITY, identity
from workflow.report.results import Results
from workflow.report.table import Column, Table
from workflow.variants import TRUTH, VARIANTS

PRECOMPUTATION = ("mesh", "material")
"""Phases that come before any method: they are needed once for a solid."""

TIMED = (TRUTH, "ddfem_slepc", "hcms", "hcms_ec", "ddfem_hcms_ec")


def solve_seconds(spectrum: ModesFile) -> float:
    """Wall time [s] from meshed solid and moduli to modes, coarsening included."""
    outside = (*PRECOMPUTATION, *CHECKS)
    timings: dict[str, float] = spectrum.attributes["timings"]
    return sum(seconds for phase, seconds in timings.items() if phase not in outside)


def precomputation_seconds(spectrum: ModesFile) -> float:
    """Wall time [s] of voxels and material."""
    return sum(spectrum.attributes["timings"].get(phase, 0.0) for phase in PRECOMPUTATION)


def times(results: Results) -> Table:
    """Wall time of every method on every model, as in Fig. 11 of the paper."""
    columns = [
        *IDENTITY,
        Column("precomputation", "Precomputation", "seconds", "s"),
    ]
    labels = {variant: VARIANTS[variant].label for variant in TIMED} | {TRUTH: "SLEPc (truth)"}
    columns += [Column(variant, labels[variant], "seconds", "s") for variant in TIMED]
    columns.append(Column("speed_up", "Speed-up over SLEPc", "times"))
    return Table(
        "times",
        "Wall seconds of one cold run each, on all cores and nothing beside it, from meshed "
        "solid and moduli to modes: coarsening, partition, assembly and solution count; voxels "
        "and material are precomputation, residuals and inertia are checked off the clock.",
        columns,
        [_times_row(results, model) for model in results.models],
    )


def _times_row(results: Results, model: str) -> dict[str, Any]:
    spectra = results.spectra[model]
    row = identity(results, model)
    row["precomputation"] = precomputation_seconds(spectra[TRUTH])
    row |= {variant: solve_seconds(spectra[variant]) for variant in TIMED}
    row["speed_up"] = row[TRUTH] / row["ddfem_hcms_ec"]
    return row


def phases(results: Results) -> Table:
    """Wall time by phase of every run."""
    return Table(
        "phases",
        "Wall seconds of every phase of every run.",
        [
            Column("model", "Solid"),
            Column("variant", "Method"),
            Column("phase", "Phase"),
            Column("seconds", "Time", "seconds", "s"),
        ],
        [
            {
                "model": model,
                "variant": VARIANTS[variant].label,
                "phase": phase,
                "seconds": seconds,
            }
            for model, spectra in results.spectra.items()
            for variant, spectrum in spectra.items()
            for phase, seconds in spectrum.attributes["timings"].items()
        ],
        ["model", "variant", "phase"],
    )
