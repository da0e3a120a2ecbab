"""Tables of the study: every model, and all of them at equal unknowns and at equal time."""

from __future__ import annotations

from collections.abc import Iterator

from studies.accuracy.results import AccuracyStudy
from studies.base.conditions import Repeats, measured
from studies.base.entry import Row

LABELS = {
    "voxel": "Voxels",
    "finite-cell": "Finite cells",
    "linear tetrahedra": "Linear tetrahedra",
    "quadratic tetrahedra": "Quadratic tetrahedra",
}


def _repeats(study: AccuracyStudy) -> Repeats:
    return Repeats(f"{study.measured['runs']}, warm", "not told; medians of the runs")


MEASURED = measured(lambda study: study.origins, _repeats)


def summary(study: AccuracyStudy) -> Iterator[Row]:
    """Rates, and errors at equal unknowns and at equal time."""
    for row in study.measured["summary"]:
        yield {**row, **_names(study, row)}


def levels(study: AccuracyStudy) -> Iterator[Row]:
    """Every model."""
    for row in study.measured["levels"]:
        yield {**row, **_names(study, row), "spacing": 1e3 * row["spacing"]}


def references(study: AccuracyStudy) -> Iterator[Row]:
    """Degrees of the polynomials, and what lower ones change."""
    for name, reference in study.measured["references"].items():
        yield {
            **reference,
            "solid": name,
            "degrees": ", ".join(map(str, reference["degrees"])),
            "first": reference["frequencies"][0],
            "last": reference["frequencies"][-1],
        }


def _names(study: AccuracyStudy, row: Row) -> Row:
    return {"title": study.titles[row["solid"]], "label": LABELS[row["discretisation"]]}
