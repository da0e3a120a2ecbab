"""Tables of the study: errors by material, every case, and what is known of the truth."""

from __future__ import annotations

import statistics
from collections.abc import Iterator

import numpy as np

from studies.base.cases import Case
from studies.base.conditions import IN_COLUMNS, NOT_TIMED, Record, Repeats, measured
from studies.base.entry import Row
from studies.discretisation.results import SOLID, VOXELS, DiscretisationStudy

FIRST = 7
AGAINST = (SOLID, VOXELS)
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
PHASES = ("mesh", "material", "model", "solve")


def _records(study: DiscretisationStudy) -> dict[str, Record]:
    return {study.label(case): rating["provenance"] for case, rating in study.ratings.items()}


def _repeats(study: DiscretisationStudy) -> Repeats:
    return Repeats(f"{study.runs}, all ways in turn, after one on a small box", IN_COLUMNS)


UNTIMED, TIMED = measured(_records, NOT_TIMED), measured(_records, _repeats)


def summary(study: DiscretisationStudy) -> Iterator[Row]:
    """Errors by material and way over all solids, and what they cost beside the voxels."""
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


def cases(study: DiscretisationStudy) -> Iterator[Row]:
    """Errors, unknowns and wall time of every way in every case."""
    for case in study.ratings:
        for name in study.ways_of(case):
            way = study.way(case, name)
            ends = {f"seconds_{end}": way["spread"][end] for end in ("min", "max")}
            yield {**way, **study.identity(case), **ends, "name": name, "way": WAYS[name]}


def truths(study: DiscretisationStudy) -> Iterator[Row]:
    """What is known of the solid itself in every case."""
    for case, rating in study.ratings.items():
        yield {**rating["truth"], **study.identity(case)}
