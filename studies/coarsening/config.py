"""Keys of the study in the configuration, and what its jobs take."""

from typing import Annotated

from annotated_types import Ge, Le

from carillon.parameters import option, parameters
from workflow.configuration.resources import JobLimits
from workflow.configuration.solids import (
    Materials,
    ModelModes,
    Solids,
    StudiedForests,
    StudiedSolid,
    default_solids,
)

SOLIDS = (
    *("bar", "bell", "frying-pan", "plate", "bunny", "teapot", "comb", "cup", "dumbbell"),
    *("eared-head", "fork", "slit-ring", "spiral", "stool"),
)
"""Solids that are studied by default."""


@parameters
class CoarseningSection:
    """The study of the worst single modes of coarse models; target coarsening computes it."""

    models: Solids[StudiedSolid] = option(
        default_solids(StudiedSolid, dict.fromkeys(SOLIDS, {"resolutions": [24]}))
    )
    materials: Materials = option(("uniform", "noise"))
    modes: Annotated[ModelModes, Le(60)] = option(
        60, "number of the last mode rated; the first is 7 [1]"
    )
    refine_to: Annotated[float, Ge(0.001), Le(10)] = option(
        0.05,
        "expected rms error of frequencies, and a third of the worst, down to which blocks stay "
        "fine [1]",
    )
    forest: StudiedForests = option(None)


SECTIONS = {"coarsening": CoarseningSection}
LIMITS = {"rate_coarsening": JobLimits("a case of the study of the worst modes", 3000, 30)}
