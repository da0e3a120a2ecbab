"""Keys of the study in the configuration, and what its jobs take."""

from typing import Annotated

from annotated_types import Ge, Le

from carillon.parameters import option, parameters
from studies.measured.data_files import solid_names
from workflow.configuration.resources import JobLimits
from workflow.configuration.section import File, Several


@parameters
class MeasuredSolidsSection:
    """The study of measured and published frequencies; target measured."""

    solids: Several[File] = option(
        tuple(solid_names()), "names of the solids, or paths of data files of others"
    )
    finer: Annotated[float, Ge(0.1), Le(10.0)] = option(
        1.0, "multiple of the resolutions that the data files ask for [1]"
    )
    refine_to: Annotated[float, Ge(1e-4), Le(1.0)] = option(
        0.002, "expected error down to which finite cells are divided [1]"
    )


SECTIONS = {"measured": MeasuredSolidsSection}
LIMITS = {
    "measure_measured_solids": JobLimits("all solids whose frequencies were measured", 4000, 60)
}
