"""Keys of the study in the configuration, and what its jobs take."""

from typing import Annotated

from annotated_types import Le

from carillon.parameters import option, parameters
from workflow.configuration.resources import JobLimits
from workflow.configuration.section import Runs
from workflow.configuration.solids import (
    Materials,
    ModelModes,
    Solids,
    StudiedForests,
    StudiedSolid,
    default_solids,
)

SOLIDS = ("bell", "bowl", "frying-pan", "pitcher", "plate", "snare-drum", "bunny", "teapot")
"""Solids that are studied by default."""


@parameters
class DiscretisationSection:
    """The study of voxels, coarse elements and finite cells by material; target discretisation
    computes it.
    """

    models: Solids[StudiedSolid] = option(
        default_solids(StudiedSolid, dict.fromkeys(SOLIDS, {"resolutions": [20]}))
    )
    materials: Materials = option(("uniform", "smooth", "two-region", "noise"))
    modes: Annotated[ModelModes, Le(1000)] = option(
        36, "number of the last mode rated; the first is 7 [1]"
    )
    runs: Runs = option(3, "rounds in which every way to the spectrum is timed once [1]")
    forest: StudiedForests = option(None)


SECTIONS = {"discretisation": DiscretisationSection}
LIMITS = {"rate_discretisation": JobLimits("a case of the study of discretisations", 6000, 30)}
