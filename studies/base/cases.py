"""Studies of solids, each at some resolutions and with some materials: a result file a case."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from studies.base.conditions import NOT_TIMED, ONE_COLD_RUN, Record, measured
from studies.base.results import Results
from studies.base.study import Study, no_files
from studies.base.table import Column, Row, each, hidden
from workflow import solids
from workflow.arguments import options, path_word

ALL = "all"
"""Name that stands for every material in pooled tables."""
UNTIMED = measured(lambda study: study.records, NOT_TIMED)
ONE_RUN = measured(lambda study: study.records, ONE_COLD_RUN)
"""Conditions of tables whose numbers are no times, or times of one run."""


@dataclass(frozen=True)
class Case:
    """One solid at one resolution with one material."""

    solid: str
    resolution: int
    material: str

    @property
    def path(self) -> str:
        """Name of the result file below the folder of the cases."""
        return f"{self.solid}/{self.resolution}-{self.material}.json"


def case_columns(shown: str = "title resolution material") -> list[Column]:
    """Columns that tell cases apart, of which people see those `shown`."""
    columns = (
        Column("model", "Model"),
        Column("title", "Solid"),
        Column("resolution", "Resolution", "count"),
        Column("material", "Material"),
    )
    return [replace(column, shown=column.key in shown.split()) for column in columns]


def error_columns(materials: Iterable[str]) -> list[Column]:
    """Columns of the rms and the worst error with each material, and with all of them."""
    return each(
        {material: material.capitalize() for material in (*materials, ALL)},
        Column("{name}_rms", "{label}, rms", "percent"),
        Column("{name}_worst", "worst", "percent"),
        hidden("{name}_where", "at"),
    )


@dataclass(frozen=True)
class CaseStudy(Study):
    """A study whose cases are measured by the command of its name, each into its own files."""

    arguments: Callable[[Mapping[str, Any]], list[str]] = no_files
    """How every case is measured, of a configuration."""
    outputs: tuple[tuple[str, str], ...] = (("out", ".json"),)
    """Files of a case: the command's options, and endings."""
    timed: bool = False
    """Whether a case takes all cores, since its wall time counts."""

    def __post_init__(self) -> None:
        super().__post_init__()
        main, *others = (partial(case_files, section=self.name, ending=e) for _, e in self.outputs)
        object.__setattr__(self, "measured", main)
        object.__setattr__(
            self, "beside", lambda config: [f for each in others for f in each(config)]
        )


def case_options(config: Mapping[str, Any], section: str, *keys: str, **others: str) -> list[str]:
    """Options that every case of a study is measured with: its forest, and keys of its part."""
    part = config[section]
    forest = part["forest"] and path_word(part["forest"])
    return options({"forest": forest, **{key: part[key] for key in keys}, **others})


def cases_of(config: Mapping[str, Any], section: str) -> list[Case]:
    """All cases of a study whose mesh exists, in the order of the configuration."""
    study = config[section]
    return [
        Case(solid, resolution, material)
        for solid in solids.named(config, f"{section}.models")
        for resolution in study["models"][solid]["resolutions"]
        for material in study["materials"]
    ]


def case_files(config: Mapping[str, Any], section: str, ending: str = ".json") -> list[str]:
    """Files of all cases below the folder of a study."""
    cases = cases_of(config, section)
    return [f"cases/{case.path.removesuffix('.json')}{ending}" for case in cases]


class CaseResults(Results):
    """The folder of such a study."""

    @cached_property
    def ratings(self) -> dict[Case, dict[str, Any]]:
        """Content of the result files by case."""
        cases = cases_of(self.config, self.section)
        return {case: self.read_json(f"cases/{case.path}") for case in cases}

    @property
    def first(self) -> dict[str, Any]:
        """Content of the first file, for what is the same in all of them."""
        return next(iter(self.ratings.values()))

    @property
    def origins(self) -> dict[str, Record]:
        """Provenance of every case."""
        return {f"cases/{case.path}": each["provenance"] for case, each in self.ratings.items()}

    @property
    def records(self) -> dict[str, Record]:
        """The same by what tables call the cases."""
        return {self.label(case): each["provenance"] for case, each in self.ratings.items()}

    @property
    def solids(self) -> list[str]:
        """Names of the solids studied."""
        return solids.named(self.config, f"{self.section}.models")

    def identity(self, case: Case) -> dict[str, Any]:
        """Values that tell a case from others."""
        return {
            "model": case.solid,
            "title": self.titles[case.solid],
            "resolution": case.resolution,
            "material": case.material,
        }

    def label(self, case: Case) -> str:
        """A case in a few words."""
        return f"{self.titles[case.solid]} {case.resolution}, {case.material}"


def pooled(study: CaseResults, errors: Mapping[Case, Mapping[str, Any]]) -> Row:
    """Rms over all cases, the worst error and where it is, with each material and with all."""
    row: Row = {}
    for material in (*study.part["materials"], ALL):
        cases = [case for case in errors if material in (case.material, ALL)]
        worst = max(cases, key=lambda case: abs(errors[case]["worst"]))
        row |= {
            f"{material}_rms": float(np.sqrt(np.mean([errors[c]["rms"] ** 2 for c in cases]))),
            f"{material}_worst": errors[worst]["worst"],
            f"{material}_where": f"{study.label(worst)}, mode {errors[worst]['worst_mode']}",
        }
    return row


def truths_of(study: CaseResults) -> Iterator[Row]:
    """Size and proof of the ground truth of every case."""
    for case, rating in study.ratings.items():
        truth = rating["truth"]
        counted = "inertia_count" in truth
        proof = f"{truth['inertia_expected']} / {truth['inertia_count']}" if counted else None
        yield {**rating, **truth, **study.identity(case), "inertia": proof}
