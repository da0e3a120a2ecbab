"""Tables of the study: every model, and all of them at equal unknowns and at equal time."""

from collections.abc import Iterator

from studies.accuracy.results import AccuracyStudy
from studies.base.conditions import Repeats, measured
from studies.base.table import Column, Row, hidden, table

LABELS = {
    "voxel": "Voxels",
    "finite-cell": "Finite cells",
    "linear tetrahedra": "Linear tetrahedra",
    "quadratic tetrahedra": "Quadratic tetrahedra",
}
SOLID = (hidden("solid", "Solid"), Column("title", "Solid"))
MODEL = (hidden("discretisation", "Discretisation"), Column("label", "Model of"))
SUMMARISED = (
    *MODEL,
    Column("rate", "Rate", "score"),
    Column("unknowns", "At unknowns", "count"),
    Column("error_at_unknowns", "rms error", "percent"),
    Column("seconds", "In time", "seconds"),
    Column("error_at_seconds", "rms error", "percent"),
)
"""Columns of what `studies.accuracy.measure.summarised` tells."""
ERRORS = (
    Column("rms", "Rms", "percent"),
    Column("expected", "Expected", "percent"),
    Column("worst", "Worst", "percent"),
    hidden("worst_mode", "at mode", "count"),
    hidden("problem", "Why not"),
)
"""Columns of the errors of one model."""


def _repeats(study: AccuracyStudy) -> Repeats:
    return Repeats(f"{study.measured['runs']}, warm", "not told; medians of the runs")


MEASURED = measured(lambda study: study.origins, _repeats)


@table(
    *SOLID,
    *SUMMARISED,
    keys="solid discretisation",
    conditions=MEASURED,
)
def summary(study: AccuracyStudy) -> Iterator[Row]:
    """Rms error of the first {measured[elastic_modes]} elastic frequencies with as many unknowns,
    and in the same wall time, as the finite cells of one level; between levels log error is
    interpolated over log unknowns or log time, and beyond them nothing is said. The rate is the
    power of the spacing with which the error falls, by least squares over all levels."""
    for row in study.measured["summary"]:
        yield {**row, **_names(study, row)}


@table(
    *SOLID,
    *MODEL,
    Column("spacing", "Spacing [mm]", "score", "mm"),
    Column("unknowns", "Unknowns", "count"),
    Column("build_seconds", "Build", "seconds"),
    Column("solve_seconds", "Solve", "seconds"),
    *ERRORS,
    keys="solid discretisation spacing",
    conditions=MEASURED,
)
def levels(study: AccuracyStudy) -> Iterator[Row]:
    """Unknowns, wall time from the surface or the solid’s description to the mesh (build) and from
    there to the modes, assembly included (solve), and relative errors of the first
    {measured[elastic_modes]} elastic frequencies, matched by index: root mean square, the one that
    finite cells expect of themselves, and the worst, negative if too low. The spacing is that
    between neighbouring nodes: half of the edge of quadratic elements."""
    for row in study.measured["levels"]:
        yield {**row, **_names(study, row), "spacing": 1e3 * row["spacing"]}


@table(
    *SOLID,
    Column("degrees", "Degrees"),
    Column("change", "Change", "percent"),
    Column("first", "First [Hz]", "hertz", "Hz"),
    Column("last", "Last [Hz]", "hertz", "Hz"),
)
def references(study: AccuracyStudy) -> Iterator[Row]:
    """Rayleigh-Ritz over the whole solid with polynomials of these degrees along its axes; the
    largest relative change that a frequency takes from degrees lower by 2, and the first and last
    frequency compared."""
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
