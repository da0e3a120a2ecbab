"""Tables of the study: every solid, models over size, lowest ratios, references."""

from collections.abc import Iterator

from studies.accuracy.tables import ERRORS, MODEL, SUMMARISED
from studies.base.conditions import NOT_TIMED, ONE_COLD_RUN, measured
from studies.base.table import Column, Row, hidden, table
from studies.thin_walls.references import HARMONICS, POLYNOMIALS, TETRAHEDRA
from studies.thin_walls.results import ThinWallStudy
from studies.thin_walls.sizes import CELLS, WHOLE
from studies.thin_walls.sizes import TETRAHEDRA as RIVAL

LABELS = {CELLS: "Finite cells", WHOLE: "Whole cells", RIVAL: "Quadratic tetrahedra"}
METHODS = {
    HARMONICS: "harmonics over triangles of the profile",
    POLYNOMIALS: "polynomials over the solid",
    TETRAHEDRA: "tetrahedra",
}
TIMED = measured(lambda study: study.origins, ONE_COLD_RUN)
UNTIMED = measured(lambda study: study.origins, NOT_TIMED)
SOLID = (hidden("solid", "Name"), Column("title", "Solid"))
RATED = (
    *SOLID,
    Column("wall", "Wall", "percent"),
    Column("position", "Position"),
    Column("unknowns", "Unknowns", "count"),
    Column("resolution", "At", "count"),
    Column("cells", "Cells by level"),
    Column("seconds", "Time", "seconds"),
    Column("rms", "Rms error", "percent"),
    Column("worst", "Worst", "percent"),
    hidden("worst_mode", "at mode", "count"),
    Column("expected", "Expected", "percent"),
    hidden("expected_worst", "worst expected", "percent"),
    Column("ratio", "Expected / true", "times"),
    Column("verdict", "Aims"),
    hidden("lowest", "Lowest ratio", "score"),
    hidden("problem", "Why not"),
)


@table(*RATED, keys="solid position", conditions=TIMED)
def walls(study: ThinWallStudy) -> Iterator[Row]:
    """Errors of the first {measured[elastic_modes]} elastic frequencies of finite cells, matched by
    index: root mean square, the worst, negative if too low, and the root mean square error that the
    program expects. Cells are asked for an error of {measured[accuracy]}, from
    {measured[resolution]} spacings along the longest side on (At: those that were taken). The wall
    is the thinnest one over the longest side. Cells by level: whole, divided once, and so on. Time
    is from the mesh file to the modes and their expected errors."""
    yield from _rows(study, "thin", "file")


@table(*RATED, keys="solid position", conditions=TIMED)
def thick(study: ThinWallStudy) -> Iterator[Row]:
    """The same of solids without thin walls."""
    yield from _rows(study, "thick")


def _rows(study: ThinWallStudy, *kinds: str) -> Iterator[Row]:
    for found in study.of_kind(*kinds):
        yield {**found, "cells": " + ".join(f"{count:,}" for count in found.get("divided", []))}


@table(
    *SOLID,
    *SUMMARISED,
    keys="solid discretisation",
    conditions=TIMED,
)
def summary(study: ThinWallStudy) -> Iterator[Row]:
    """Rms error of turned solids with as many unknowns, and in the same wall time, as the finite
    cells of the size in the middle; between sizes log error is interpolated over log unknowns or
    log time, and beyond them nothing is said. The rate is the power of the spacing with which the
    error falls, by least squares over all sizes. Finite cells are divided as by default, whole
    cells are not."""
    for row in study.measured["summary"]:
        yield {**row, **_named(study, row)}


@table(
    *SOLID,
    *MODEL,
    Column("spacing", "Spacing [mm]", "score", "mm"),
    Column("unknowns", "Unknowns", "count"),
    Column("seconds", "Time", "seconds"),
    *ERRORS,
    keys="solid discretisation spacing",
    conditions=TIMED,
)
def levels(study: ThinWallStudy) -> Iterator[Row]:
    """Models of turned solids in several sizes. The spacing is that of the lattice, and half of the
    edge of tetrahedra, whose time is from the solid’s exact description to the modes."""
    for row in study.measured["levels"]:
        yield {**row, **_named(study, row), "spacing": 1e3 * row["spacing"]}


@table(
    *SOLID,
    Column("doubt", "Doubt of the reference", "percent"),
    Column("rated", "Lattices", "count"),
    hidden("lattices", "tried", "count"),
    Column("below", "Lowest below", "percent"),
    hidden("lowest", "Lowest ratio", "score"),
    Column("mode", "Mode", "count"),
    Column("resolution", "At", "count"),
    Column("shift", "Shift", "score"),
    Column("verdict", "Verdict"),
    hidden("problem", "Why not"),
    conditions=UNTIMED,
)
def bounds(study: ThinWallStudy) -> Iterator[Row]:
    """How far the lowest of the first {bounds[elastic_modes]} elastic frequencies is below the
    reference, negative if none is, over lattices of several resolutions and shifts (in cells) of
    the {bounds[position]} solid, cells undivided. A frequency of a method of this kind is never
    below that of the solid: one that is further below than the doubt and the facets explain would
    be of no mode of the solid."""
    for name, title in study.bounds["titles"].items():
        found = study.lowest(name)
        below = 1.0 - found["lowest"] if "lowest" in found else None
        doubt = study.bounds["doubts"][name]
        yield {**found, "solid": name, "title": title, "doubt": doubt, "below": below}


@table(
    *SOLID,
    Column("method", "By"),
    Column("how", "Sizes"),
    Column("doubt", "Doubt", "percent"),
    Column("first", "First [Hz]", "hertz", "Hz"),
    Column("last", "Last [Hz]", "hertz", "Hz"),
)
def references(study: ThinWallStudy) -> Iterator[Row]:
    """Frequencies that no finite cell made, of E = 1 GPa, a Poisson’s ratio of 0.25 and 1000 kg/m³:
    Fourier harmonics over quadratic triangles of the profile of a solid of revolution, polynomials
    over the whole solid (Rayleigh and Ritz), or quadratic tetrahedra. The doubt is the largest
    relative change that a frequency takes from a coarser mesh, or lower degrees; all are bounds
    from above."""
    for name, found in study.measured["references"].items():
        yield {
            **found,
            "solid": name,
            "title": study.titles[name],
            "method": METHODS[found["method"]],
            "first": found["hertz"][0],
            "last": found["hertz"][-1],
        }


def _named(study: ThinWallStudy, row: Row) -> Row:
    return {"title": study.titles[row["solid"]], "label": LABELS[row["discretisation"]]}
