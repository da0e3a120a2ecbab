"""Keys of the study in the configuration, and what its jobs take."""

from dataclasses import KW_ONLY
from typing import Any

from carillon.parameters import REQUIRED, option, parameters
from carillon.parameters.quantities import Discretisation, Resolution, Seed
from workflow.configuration.resources import JobLimits
from workflow.configuration.section import RankCounts, RelativeError, Several
from workflow.configuration.solids import (
    Materials,
    ModelModes,
    SolidEntry,
    Solids,
    StudiedForests,
    default_solids,
)

SOLIDS: dict[str, dict[str, Any]] = {
    "bar": {"resolution": 24},
    "bell": {"resolution": 24},
    "frying-pan": {"resolution": 32},
    "pitcher": {"resolution": 24},
    "snare-drum": {"resolution": 24},
    "cymbal": {"resolution": 20, "discretisation": "finite-cell"},
}
"""Solids that are validated by default."""


@parameters
class CampaignSolid(SolidEntry):
    """A solid of the campaign."""

    _: KW_ONLY
    resolution: Resolution = option(REQUIRED)
    discretisation: Discretisation = option("voxel")


@parameters
class CampaignSection:
    """Validations of solids with materials, seeds and ranks, judged together; target campaign
    computes them.
    """

    models: Solids[CampaignSolid] = option(default_solids(CampaignSolid, SOLIDS))
    materials: Materials = option(("uniform", "smooth", "two-region", "random", "noise"))
    seeds: Several[Seed] = option(
        (0, 1), "seeds of material and partition that every solid is given with every material"
    )
    ranks: RankCounts = option((1, 2), "numbers of MPI ranks that each is computed on [1]")
    modes: ModelModes = option(60)
    frequency_rms: RelativeError = option(
        0.3,
        "largest root mean square error of the coarsened solid's frequencies that passes, modes 7 "
        "to 60; in place of that in validation.tolerances, since these solids are coarse [1]",
    )
    frequency_worst: RelativeError = option(
        1.0, "largest error of any of these frequencies that passes; likewise [1]"
    )
    forest: StudiedForests = option(None)


SECTIONS = {"campaign": CampaignSection}
LIMITS = {"validate_cell": JobLimits("a cell of a campaign, with all its jobs", 8000, 120)}
