"""Studies of solids, each at some resolutions and with some materials: a result file a case."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from studies.base.conditions import Record
from studies.base.results import Results
from workflow import solids


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
    def origins(self) -> dict[str, Record]:
        """Provenance of every case."""
        return {f"cases/{case.path}": each["provenance"] for case, each in self.ratings.items()}

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
