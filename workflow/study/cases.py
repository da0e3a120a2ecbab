"""Which solids, resolutions and materials the objectives are compared on, and the results there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from solver.coarsening.forest import FOREST
from workflow import settings
from workflow.study_folder import StudyFolder


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


def absent_meshes(config: Mapping[str, Any]) -> dict[str, str]:
    """Mesh files that do not exist, by the solid that is left out for it."""
    meshes = {
        solid: settings.studied_mesh(config, solid) for solid in config["objectives"]["models"]
    }
    return {
        solid: mesh
        for solid, mesh in meshes.items()
        if not mesh.startswith(settings.BUILTIN) and not Path(mesh).is_file()
    }


def cases_of(config: Mapping[str, Any]) -> list[Case]:
    """All cases whose mesh exists, in the order of the configuration."""
    study, absent = config["objectives"], absent_meshes(config)
    return [
        Case(solid, resolution, material)
        for solid, model in study["models"].items()
        if solid not in absent
        for resolution in model["resolutions"]
        for material in study["materials"]
    ]


def solids_of(config: Mapping[str, Any]) -> list[str]:
    """Names of the solids whose mesh exists."""
    return list(dict.fromkeys(case.solid for case in cases_of(config)))


class Study(StudyFolder):
    """The folder of the objectives' study."""

    @cached_property
    def found(self) -> dict[Case, dict[str, Any]]:
        """Output of `solver objectives` by case."""
        return {case: self.read_json(f"cases/{case.path}") for case in cases_of(self.config)}

    @property
    def solids(self) -> list[str]:
        """Names of the solids studied."""
        return solids_of(self.config)

    @property
    def materials(self) -> list[str]:
        """Names of the materials studied."""
        materials: list[str] = self.config["objectives"]["materials"]
        return materials

    @property
    def coarsenings(self) -> list[str]:
        """Names of the objectives and the baselines."""
        return [row["coarsening"] for row in next(iter(self.found.values()))["rows"]]

    @property
    def forest(self) -> dict[str, str] | None:
        """Which forests are compared: `forest`, `forest_objective`, `forest_sha256`; or None."""
        found: dict[str, str] | None = next(iter(self.found.values())).get("forest")
        return found

    @property
    def without_forest(self) -> str:
        """One sentence about why no forests are among the coarsenings; empty if they are."""
        reason: str = next(iter(self.found.values())).get("without_forest", "")
        return reason

    @property
    def last_audible(self) -> int:
        """Last mode of the range 7..60, which ends earlier if fewer modes were asked for."""
        return max(self._last("audible"))

    @property
    def last(self) -> int:
        """Last mode compared."""
        return max(self._last("all"))

    def _last(self, part: str) -> list[int]:
        return [row[part]["last"] for found in self.found.values() for row in found["rows"]]

    def title(self, solid: str) -> str:
        """Name of a solid for people."""
        own: str = self.config["objectives"]["models"][solid]["title"]
        return own or solid.replace("-", " ").capitalize()

    def errors(self, case: Case, coarsening: str) -> dict[str, Any]:
        """Row of a case that belongs to a coarsening."""
        rows: list[dict[str, Any]] = self.found[case]["rows"]
        return next(row for row in rows if row["coarsening"] == coarsening)

    def rms(self, case: Case, coarsening: str) -> float:
        """Root mean square of the errors of modes 7..60."""
        return float(self.errors(case, coarsening)["audible"]["rms"])

    def forest_over_fit(self, case: Case) -> float | None:
        """Rms error of the forests over that of the fit they learned; None unless both are here."""
        if self.forest is None or self.forest["forest_objective"] not in self.coarsenings:
            return None
        return self.rms(case, FOREST) / self.rms(case, self.forest["forest_objective"])


def study_beside(config: str | Path) -> Study:
    """Study of the run whose resolved configuration is the file `config`."""
    return Study(Path(config).parent / "objectives")


def without(config: Mapping[str, Any]) -> str:
    """One sentence about the solids that are left out; empty if there are none."""
    absent = absent_meshes(config)
    if not absent:
        return ""
    return (
        f"Without {' and '.join(absent)}: there is no {' and no '.join(absent.values())}; put "
        "the files there, or set mesh_folder to the folder that holds them."
    )
