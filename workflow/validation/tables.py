"""Tables of the page; their files are named after the model."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from carillon.fem.model import RIGID_MODES
from studies.base.entry import Row
from workflow.validation.criteria import judge
from workflow.validation.distance import distance_in_words
from workflow.validation.evidence import Evidence
from workflow.variants import FROM_SOLID, TRUTH, VARIANTS


def criteria(evidence: Evidence) -> list[Row]:
    """Every criterion with value, limit and verdict."""
    return [criterion.row for criterion in judge(evidence)]


def solid(evidence: Evidence) -> Iterator[Row]:
    """How far the frequencies of the fine mesh are from the solid's."""
    settings, distance = evidence.settings, evidence.distance
    row = {
        "discretisation": settings["discretisation"],
        "resolution": settings["resolution"],
        "unknowns": evidence.shown[FROM_SOLID].model.n_dofs,
        "told": distance_in_words(evidence)["told"],
    }
    if distance:
        first, last = distance["modes"]
        row |= {**distance, "modes": f"{first}–{last}"}
    yield row


def errors(evidence: Evidence) -> Iterator[Row]:
    """Eigenvalue and frequency errors of every elastic mode."""
    spectra = evidence.shown
    truth = spectra[TRUTH]
    for index in range(RIGID_MODES, min(len(part.eigenvalues) for part in spectra.values())):
        row = {"mode": index + 1, TRUTH: float(truth.frequencies[index])}
        for variant in evidence.compared:
            spectrum = spectra[variant]
            row[variant] = float(spectrum.frequencies[index])
            row[f"{variant}_frequency"] = row[variant] / row[TRUTH] - 1.0
            ratio = spectrum.eigenvalues[index] / truth.eigenvalues[index]
            row[f"{variant}_eigenvalue"] = float(ratio) - 1.0
        yield row


def shapes(evidence: Evidence) -> Iterator[Row]:
    """How far the spaces of modes are turned against the truth's."""
    first_mode = evidence.read_json(f"figures/{evidence.model}-mode.json")
    for variant in evidence.compared:
        clusters = evidence.compared[variant]["clusters"]
        row = {
            "method": VARIANTS[variant].label,
            "clusters": len(clusters),
            "likeness": first_mode[variant]["likeness"],
        }
        if clusters:
            worst = max(clusters, key=lambda cluster: cluster["angle"])
            alone = worst["first"] == worst["last"]
            row |= {
                "several": sum(cluster["last"] > cluster["first"] for cluster in clusters),
                "median": float(np.median([cluster["angle"] for cluster in clusters])),
                "largest": worst["angle"],
                "modes": str(worst["first"]) if alone else f"{worst['first']}–{worst['last']}",
            }
        yield row


def audits(evidence: Evidence) -> list[Row]:
    """What each modes file proves, found anew from the file alone."""
    spectra = evidence.audit["spectra"]
    return [
        {
            "method": VARIANTS[name].label,
            **spectra[name],
            "energy_max": max(spectra[name]["energy_residuals"]),
        }
        for name in evidence.shown
    ]


def responses(evidence: Evidence) -> Iterator[Row]:
    """How far motion and sound after a strike are from the truth's."""
    for variant in evidence.shown:
        response = evidence.response.responses[variant]
        row = {
            "method": VARIANTS[variant].label,
            "audible": response.audible,
            "peak": float(np.linalg.norm(response.displacement, axis=1).max()),
        }
        if variant != TRUTH:
            row["difference"] = response.difference
            row["distance_decibels"] = response.distance_decibels
        yield row
