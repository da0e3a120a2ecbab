"""Tables of the page; their files are named after the model."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from carillon.fem.model import RIGID_MODES
from solver.response.response_file import Response
from workflow.report.evidence_tables import provenance_table
from workflow.report.table import Column, Table
from workflow.validate.criteria import Criterion
from workflow.validate.evidence import COMPARED, Evidence
from workflow.variants import SHOWN, TRUTH, VARIANTS


def criteria(evidence: Evidence, judged: Sequence[Criterion]) -> Table:
    """Every criterion with value, limit and verdict."""
    return Table(
        f"{evidence.model}-criteria",
        "Every criterion, what was found, what is required, and where the number lies.",
        [
            Column("group", "Spectrum"),
            Column("key", "Key"),
            Column("label", "Criterion"),
            Column("shown", "Found"),
            Column("required", "Required"),
            Column("verdict", "Verdict"),
            Column("found", "Raw value", shown=False),
            Column("limit", "Raw limit", shown=False),
            Column("why", "Why it matters"),
            Column("source", "Source"),
        ],
        [criterion.row for criterion in judged],
        ["group", "key"],
    )


def errors(evidence: Evidence) -> Table:
    """Eigenvalue and frequency errors of every elastic mode."""
    columns = [Column("mode", "Mode", "count"), Column(TRUTH, VARIANTS[TRUTH].label, "hertz", "Hz")]
    for variant in COMPARED:
        columns += [
            Column(variant, VARIANTS[variant].label, "hertz", "Hz"),
            Column(f"{variant}_frequency", "error", "percent"),
            Column(f"{variant}_eigenvalue", "of the eigenvalue", "percent", shown=False),
        ]
    return Table(
        f"{evidence.model}-errors",
        "Natural frequencies [Hz] by mode number, and their relative errors against the ground "
        "truth. Eigenvalues err about twice as much; the file holds those of all modes.",
        columns,
        list(_error_rows(evidence)),
        ["mode"],
    )


def _error_rows(evidence: Evidence) -> Iterator[dict[str, Any]]:
    spectra = evidence.spectra
    truth = spectra[TRUTH]
    for index in range(RIGID_MODES, min(len(part.eigenvalues) for part in spectra.values())):
        row = {"mode": index + 1, TRUTH: float(truth.frequencies[index])}
        for variant in COMPARED:
            found = spectra[variant]
            row[variant] = float(found.frequencies[index])
            row[f"{variant}_frequency"] = row[variant] / row[TRUTH] - 1.0
            ratio = found.eigenvalues[index] / truth.eigenvalues[index]
            row[f"{variant}_eigenvalue"] = float(ratio) - 1.0
        yield row


def shapes(evidence: Evidence) -> Table:
    """How far the spaces of modes are turned against the truth's."""
    return Table(
        f"{evidence.model}-shapes",
        "Mass-weighted angles between the ground truth's modes and each method's. Modes whose "
        "eigenvalues lie within 0.1 % of each other are a cluster and compared as one space. 90° "
        "means that a mode has changed places with another one.",
        [
            Column("method", "Method"),
            Column("clusters", "Clusters compared", "count"),
            Column("several", "of several modes", "count"),
            Column("median", "Median angle", "angle", "rad"),
            Column("largest", "Largest angle", "angle", "rad"),
            Column("modes", "in modes"),
            Column("likeness", "Likeness of mode 7", "fraction"),
        ],
        [_shape_row(evidence, variant) for variant in COMPARED],
    )


def _shape_row(evidence: Evidence, variant: str) -> dict[str, Any]:
    clusters = evidence.comparisons[variant]["clusters"]
    row = {
        "method": VARIANTS[variant].label,
        "clusters": len(clusters),
        "likeness": evidence.mode_pictures[variant]["likeness"],
    }
    if not clusters:
        return row
    worst = max(clusters, key=lambda cluster: cluster["angle"])
    alone = worst["first"] == worst["last"]
    return row | {
        "several": sum(cluster["last"] > cluster["first"] for cluster in clusters),
        "median": float(np.median([cluster["angle"] for cluster in clusters])),
        "largest": worst["angle"],
        "modes": str(worst["first"]) if alone else f"{worst['first']}–{worst['last']}",
    }


def audits(evidence: Evidence) -> Table:
    """What each modes file proves, found anew from the file alone."""
    return Table(
        f"{evidence.model}-audits",
        "Found anew from each modes file alone: K and M are assembled from the mesh and the moduli "
        "in the file by other code than the solver's own. Counted: eigenvalues below a value in a "
        "gap near the end, by the inertia of K − μM; found: those that the file holds.",
        [
            Column("method", "Method"),
            Column("unknowns", "Unknowns", "count"),
            Column("modes", "Modes", "count"),
            Column("residual_median", "Residual, median", "small"),
            Column("residual_max", "largest", "small"),
            Column("orthogonality", "|XᵀMX − I|", "small"),
            Column("rigid_modes", "Rigid modes", "count"),
            Column("expected", "Found", "count"),
            Column("counted", "Counted", "count"),
            Column("counted_below", "below", "small", "rad^2/s^2", shown=False),
            Column("mass", "Mass", "small", "kg", shown=False),
        ],
        [
            {"method": VARIANTS[variant].label, **evidence.audits[variant]}
            for variant in SHOWN
            if variant in evidence.audits
        ],
    )


def responses(evidence: Evidence) -> Table:
    """How far motion and sound after a strike are from the truth's."""
    found = evidence.response.responses
    return Table(
        f"{evidence.model}-responses",
        "Motion and sound after a strike. Difference of motion: relative 2-norm of the difference "
        "to the ground truth over the time shown. Difference of sound: rms difference of the "
        "spectrograms where either is within 60 dB of the loudest.",
        [
            Column("method", "Method"),
            Column("audible", "Modes heard", "count"),
            Column("peak", "Largest displacement [m]", "small", "m"),
            Column("difference", "Difference of motion", "percent"),
            Column("distance_decibels", "of sound [dB]", "small", "dB"),
        ],
        [_response_row(variant, found[variant]) for variant in SHOWN],
    )


def _response_row(variant: str, found: Response) -> dict[str, Any]:
    row = {
        "method": VARIANTS[variant].label,
        "audible": found.audible,
        "peak": float(np.linalg.norm(found.displacement, axis=1).max()),
    }
    if variant == TRUTH:
        return row
    return row | {"difference": found.difference, "distance_decibels": found.distance_decibels}


def provenance(evidence: Evidence) -> Table:
    """Command, code and machine behind every file that the page draws on."""
    origins = {
        evidence.file(f"{variant}.h5"): spectrum.provenance
        for variant, spectrum in evidence.spectra.items()
    }
    for variant, comparison in evidence.comparisons.items():
        origins[evidence.file(f"{variant}.comparison.json")] = comparison.get("provenance", {})
    origins[evidence.file("audit.json")] = evidence.audit_record
    origins[evidence.file("response.h5")] = evidence.response.provenance
    table = provenance_table(origins)
    return Table(
        f"{evidence.model}-{table.name}", table.caption, table.columns, table.rows, table.keys
    )
