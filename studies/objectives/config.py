"""Keys of the study in the configuration, and what its jobs take."""

from dataclasses import KW_ONLY
from typing import Annotated, Any, Literal

from annotated_types import Gt, Le

from carillon.parameters import REQUIRED, OneOf, option, parameters
from carillon.parameters.documents import parameters_from
from carillon.parameters.quantities import Resolution
from dataset_gen.objectives import OBJECTIVES
from workflow.configuration.resources import JobLimits
from workflow.configuration.section import Line, Several
from workflow.configuration.solids import (
    Materials,
    ModelModes,
    Solids,
    StudiedForests,
    StudiedSolid,
    default_solids,
)

SOLIDS = {
    "box": {"resolutions": [16, 24]},
    "bunny": {"resolutions": [24, 32]},
    "teapot": {"resolutions": [32, 40]},
    "bell": {"resolutions": [24, 32]},
    "frying-pan": {"resolutions": [32, 40]},
}
"""Solids that are studied by default."""
BUNNY = {"model": "bunny", "resolutions": [24], "materials": ["uniform", "noise", "random"]}
GOALS: tuple[dict[str, Any], ...] = (
    {"model": "box", "quantity": "rms", "limit": 0.03},
    {**BUNNY, "quantity": "rms_of_galerkin", "limit": 0.3333},
    {**BUNNY, "quantity": "rms", "limit": 0.05},
    {**BUNNY, "quantity": "worst", "limit": 0.12},
    {"quantity": "rms_of_fit", "limit": 1.1},
)
"""Limits that are judged by default."""


@parameters
class GoalEntry:
    """A limit on the errors of one solid, or of all."""

    _: KW_ONLY
    model: Line | None = option(None, "name of the solid; all if null")
    resolutions: tuple[Resolution, ...] | None = option(
        None, "resolutions that the limit is for; all if null"
    )
    materials: tuple[Line, ...] | None = option(
        None, "materials that the limit is for; all if null"
    )
    quantity: Literal["rms", "rms_of_galerkin", "rms_of_fit", "worst"] = option(
        REQUIRED,
        "one of rms, the rms frequency error, rms_of_galerkin, its ratio to Galerkin's, "
        "rms_of_fit, the forests' ratio to the fit they learned, and worst, the largest error of "
        "one frequency",
    )
    limit: Annotated[float, Gt(0), Le(1e6)] = option(
        REQUIRED, "largest value that keeps the limit [1]"
    )


@parameters
class ObjectivesSection:
    """The study that compares the fit objectives by spectra; target objectives computes it."""

    models: Solids[StudiedSolid] = option(default_solids(StudiedSolid, SOLIDS))
    materials: Materials = option(("uniform", "smooth", "two-region", "noise", "random"))
    modes: ModelModes = option(256, "modes compared, rigid ones included [1]")
    objectives: Several[Annotated[str, OneOf(*OBJECTIVES)]] | None = option(
        None, "names of the objectives that are compared; all that dataset_gen has if null"
    )
    forest: StudiedForests = option(
        None,
        "forests set beside the fits, relative to the working directory; those of the package if "
        "null",
    )
    goals: tuple[GoalEntry, ...] = option(
        lambda: tuple(parameters_from(each, GoalEntry) for each in GOALS),
        "limits that an objective should keep on modes 7 to 60, every material or resolution if "
        "none is named",
    )


SECTIONS = {"objectives": ObjectivesSection}
LIMITS = {"rate_objectives": JobLimits("a case of the study of the objectives", 3000, 60)}
