"""The cases of the study: solids on ranks."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from carillon.parameters.documents import parameters_from
from studies.crossover.config import SECTION, Launch
from workflow import settings, solids
from workflow.arguments import options


@dataclass(frozen=True)
class SolidOnRanks:
    """A solid at a resolution on some ranks: all that one job measures."""

    solid: str
    resolution: int
    launch: Launch

    @property
    def path(self) -> str:
        """Its result file below the folder of the study."""
        return f"cases/{self.solid}/{self.resolution}-{self.launch.label}.json"


def cases_of(config: Mapping[str, Any]) -> list[SolidOnRanks]:
    """All cases whose mesh exists, in the order of the configuration."""
    part = config[SECTION]
    return [
        SolidOnRanks(solid, resolution, parameters_from(launch, Launch))
        for solid in solids.named(config, f"{SECTION}.models")
        for resolution in part["models"][solid]["resolutions"]
        for launch in part["launches"]
    ]


def case_at(config: Mapping[str, Any], path: str) -> SolidOnRanks:
    """The case whose result file ends with `path`."""
    return next(case for case in cases_of(config) if path.endswith(case.path))


def solid_arguments(config: Mapping[str, Any], case: SolidOnRanks) -> list[str]:
    """Words of `carillon modes` that describe the solid of a case."""
    part = config[SECTION]
    how = {
        "resolution": case.resolution,
        "material": part["material"],
        "components": part["models"][case.solid]["components"],
        "poisson": config["poisson"],
    }
    return [settings.mesh_of(config, case.solid, SECTION), *options(how), "--no-estimate"]
