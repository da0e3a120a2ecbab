"""Which solids, resolutions and materials the objectives are compared on, and the results there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from solver.coarsening.forest import FOREST
from workflow import solids
from workflow.studies.base.conditions import Record
from workflow.studies.base.results import Results

SECTION = "objectives"


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


def cases_of(config: Mapping[str, Any]) -> list[Case]:
    """All cases whose mesh exists, in the order of the configuration."""
    study = config[SECTION]
    return [
        Case(solid, resolution, material)
        for solid in solids.named(config, f"{SECTION}.models")
        for resolution in study["models"][solid]["resolutions"]
        for material in study["materials"]
    ]


class Objectives(Results):
    """The folder of the objectives' study."""

    section = SECTION

    @cached_property
    def ratings(self) -> dict[Case, dict[str, Any]]:
        """Output of `solver objectives` by case."""
        return {case: self.read_json(f"cases/{case.path}") for case in cases_of(self.config)}

    @property
    def origins(self) -> dict[str, Record]:
        """Provenance of every case."""
        return {f"cases/{case.path}": each["provenance"] for case, each in self.ratings.items()}

    @property
    def solids(self) -> list[str]:
        """Names of the solids studied."""
        return solids.named(self.config, f"{SECTION}.models")

    @property
    def coarsenings(self) -> list[str]:
        """Names of the objectives and the baselines."""
        return [row["coarsening"] for row in self._any["rows"]]

    @property
    def forest(self) -> dict[str, str] | None:
        """Which forests are compared: `forest`, `forest_objective`, `forest_sha256`; or None."""
        return self._any.get("forest")

    @property
    def without_forest(self) -> str:
        """One sentence about why no forests are among the coarsenings; empty if they are."""
        return self._any.get("without_forest", "")

    @property
    def _any(self) -> dict[str, Any]:
        """The first case, for what is the same in all of them."""
        return next(iter(self.ratings.values()))

    def last(self, part: str) -> int:
        """Last mode compared: of the `audible` 7..60, or of `all`; earlier if fewer were wanted."""
        rows = (row for rating in self.ratings.values() for row in rating["rows"])
        return max(row[part]["last"] for row in rows)

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

    def errors(self, case: Case, coarsening: str) -> dict[str, Any]:
        """Row of a case that belongs to a coarsening."""
        rows: list[dict[str, Any]] = self.ratings[case]["rows"]
        return next(row for row in rows if row["coarsening"] == coarsening)

    def rms(self, case: Case, coarsening: str) -> float:
        """Root mean square of the errors of modes 7..60."""
        return float(self.errors(case, coarsening)["audible"]["rms"])

    def forest_over_fit(self, case: Case) -> float | None:
        """Rms error of the forests over that of the fit they learned; None unless both are here."""
        if self.forest is None or self.forest["forest_objective"] not in self.coarsenings:
            return None
        return self.rms(case, FOREST) / self.rms(case, self.forest["forest_objective"])
