"""Tables of the study: errors by material, every case, and what is known of the truth."""

import statistics
from collections.abc import Iterator

import numpy as np

from studies.base.cases import UNTIMED, Case, case_columns
from studies.base.conditions import IN_COLUMNS, Repeats, measured
from studies.base.table import Column, Row, each, hidden, spread, table
from studies.discretisation.results import DiscretisationStudy

AGAINST = {"solid": "Solid", "voxels": "Voxels"}
"""References of errors, the solid itself and its voxels, for people."""
WAYS = {
    "voxels": "Voxels",
    "coarse": "DDFEM* of voxels",
    "refined": "DDFEM*, refined",
    "half-cells": "Finite cells, half as fine",
    "half-cells-divided": "Half as fine, some divided",
    "half-cells-harmonic": "Half as fine, harmonic means",
    "cells": "Finite cells",
}
"""All ways, for people."""
PHASES = {"mesh": "Mesh", "material": "Material", "model": "Model", "solve": "Solve"}


def _repeats(study: DiscretisationStudy) -> Repeats:
    return Repeats(f"{study.runs}, all ways in turn, after one on a small box", IN_COLUMNS)


TIMED = measured(lambda study: study.records, _repeats)


@table(
    Column("material", "Material"),
    Column("way", "Way"),
    each(
        AGAINST,
        Column("{name}_rms", "{label}, rms", "percent"),
        Column("{name}_median", "median", "percent"),
        Column("{name}_worst", "worst", "percent"),
        hidden("{name}_where", "at"),
    ),
    Column("n_dofs", "Unknowns over voxels’", "score"),
    Column("seconds", "Time over voxels’", "score"),
    Column("doubt", "Doubt", "percent"),
    keys="material way",
    conditions=TIMED,
)
def summary(study: DiscretisationStudy) -> Iterator[Row]:
    """Relative errors of the frequencies of modes 7–{last}, modes matched by index, against the
    solid itself and against its voxels: root mean square over all solids, each weighing the same,
    rms of the median solid, and the worst single frequency, negative if too low. Unknowns and wall
    time are those of the median solid, over those of its voxels. The doubt is the error that the
    truth itself may have."""
    for material in study.part["materials"]:
        cases = [case for case in study.ratings if case.material == material]
        for name in study.ways_of(cases[0]):
            row: Row = {"material": material, "way": WAYS[name]}
            for against in AGAINST:
                row |= _pooled(study, cases, name, against)
            for key in ("n_dofs", "seconds"):
                row[key] = statistics.median(
                    study.way(case, name)[key] / study.way(case, "voxels")[key] for case in cases
                )
            yield row | {"doubt": _doubt(study, cases)}


def _pooled(study: DiscretisationStudy, cases: list[Case], name: str, against: str) -> Row:
    errors = {case: study.way(case, name)["against"][against] for case in cases}
    worst = max(cases, key=lambda case: abs(errors[case]["worst"]))
    return {
        f"{against}_rms": _root_mean_square([each["rms"] for each in errors.values()]),
        f"{against}_median": statistics.median(each["rms"] for each in errors.values()),
        f"{against}_worst": errors[worst]["worst"],
        f"{against}_where": f"{study.label(worst)}, mode {errors[worst]['worst_mode']}",
    }


def _doubt(study: DiscretisationStudy, cases: list[Case]) -> float:
    return _root_mean_square([study.ratings[case]["truth"]["doubt_rms"] for case in cases])


def _root_mean_square(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


@table(
    case_columns("title material"),
    hidden("name", "Name"),
    Column("way", "Way"),
    Column("unknowns", "Unknowns", "count", source="n_dofs"),
    each(
        AGAINST,
        Column("{name}_rms", "{label}, rms", "percent", source="against.{name}.rms"),
        Column("{name}_worst", "worst", "percent", source="against.{name}.worst"),
        hidden("{name}_mode", "at mode", "count", source="against.{name}.worst_mode"),
    ),
    spread("seconds", "Time", "seconds"),
    each(PHASES, hidden("{name}_seconds", "{label}", "seconds", source="phases.{name}")),
    keys="model resolution material name",
    conditions=TIMED,
)
def cases(study: DiscretisationStudy) -> Iterator[Row]:
    """Relative errors of the frequencies of modes 7–{last}, modes matched by index, against the
    solid itself and against its voxels. Seconds are wall time from the surface to the modes: mesh,
    moduli of its voxels by the material, model, and modes to {first[tolerance]:g}, the coarsening
    and, of the refined model, all its steps included; median, least and greatest of the runs."""
    for case in study.ratings:
        for name in study.ways_of(case):
            way = study.way(case, name)
            ends = {f"seconds_{end}": way["spread"][end] for end in ("min", "max")}
            yield {**way, **study.identity(case), **ends, "name": name, "way": WAYS[name]}


@table(
    case_columns(),
    Column("unknowns", "Unknowns", "count", source="n_dofs"),
    Column("doubt_rms", "Doubt, rms", "percent"),
    Column("doubt_worst", "largest", "percent"),
    keys="model resolution material",
    conditions=UNTIMED,
)
def truths(study: DiscretisationStudy) -> Iterator[Row]:
    """Frequencies of the solids themselves are those of finite cells on a lattice twice as fine,
    less half of what may be left of the difference from finite cells on the lattice of the voxels;
    the doubt is as much: rms and largest over modes 7–{last}."""
    for case, rating in study.ratings.items():
        yield {**rating["truth"], **study.identity(case)}
