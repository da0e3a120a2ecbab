"""Keys of the study in the configuration, and what its jobs take."""

from typing import Annotated, Literal

from annotated_types import Ge, Le

from carillon.parameters import option, parameters
from workflow.configuration.resources import JobLimits
from workflow.configuration.section import Several

ReferenceName = Literal["block", "plate", "beam", "sphere", "ellipsoid", "cylinder"]


@parameters
class AccuracySection:
    """The study of discretisations against frequencies that no mesh made; target accuracy."""

    solids: Several[ReferenceName] = option(
        ("block", "plate", "beam", "sphere", "ellipsoid", "cylinder"), "names of the solids"
    )
    levels: Annotated[int, Ge(2), Le(4)] = option(
        4, "sizes of each discretisation, coarsest first [1]"
    )
    runs: Annotated[int, Ge(1), Le(100)] = option(3, "timed runs, of which medians are told [1]")


SECTIONS = {"accuracy": AccuracySection}
LIMITS = {"measure_accuracy": JobLimits("all solids of the study of discretisations", 4000, 120)}
