"""The cells of a campaign, and the command that validates each."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

from workflow import settings, solids
from workflow.arguments import options, path_word

SECTION = "campaign"
LIMITS = ("frequency_rms", "frequency_worst")
"""Limits of the coarsened solids, which are the campaign's own."""


@dataclass(frozen=True)
class Cell:
    """One solid with one material and seed on a number of ranks."""

    solid: str
    material: str
    seed: int
    ranks: int

    @property
    def path(self) -> str:
        """Its folder below that of the cells."""
        return f"{self.solid}/{self.material}-{self.seed}-{self.ranks}"


def cells_of(config: Mapping[str, Any]) -> list[Cell]:
    """All cells whose mesh exists, in the order of the configuration."""
    part = config[SECTION]
    named = solids.named(config, f"{SECTION}.models")
    return [
        Cell(*values) for values in product(named, part["materials"], part["seeds"], part["ranks"])
    ]


def validation_arguments(config: Mapping[str, Any], cell: Cell) -> list[str]:
    """Arguments of `carillon validate` for a cell, but for its folder."""
    part, model = config[SECTION], config[SECTION]["models"][cell.solid]
    damping = ("mass_damping", "stiffness_damping")
    how = {
        "resolution": model["resolution"],
        "discretisation": model["discretisation"],
        "material": cell.material,
        "seed": cell.seed,
        "ranks": cell.ranks,
        "modes": part["modes"],
        "components": model["components"],
        "poisson": config["poisson"],
        "tolerance": config["solver"]["tolerance"],
        "forest": part["forest"] and path_word(part["forest"]),
        "name": model["title"] or cell.solid,
        **{key: config["validation"][key] for key in damping},
        "tolerances": [f"{name}={value:g}" for name, value in _limits(config).items()],
    }
    return [settings.mesh_of(config, cell.solid, SECTION), *options(how)]


def _limits(config: Mapping[str, Any]) -> dict[str, float]:
    """Limits that are set; those of the coarsened solids are the campaign's own."""
    limits = config["validation"]["tolerances"] | {key: config[SECTION][key] for key in LIMITS}
    return {name: value for name, value in limits.items() if value is not None}
