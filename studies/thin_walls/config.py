"""Keys of the study in the configuration, and what its jobs take."""

from typing import Annotated

from annotated_types import Ge, Le

from carillon.parameters import option, parameters
from studies.thin_walls.catalogue import NAMES, SolidName
from workflow.configuration.resources import JobLimits
from workflow.configuration.section import Distinct, File, Several


@parameters
class ThinWallsSection:
    """The study of finite cells on thin curved walls; target thin_walls."""

    solids: Several[SolidName] = option(NAMES, "names of the solids")
    meshes: Distinct[File] = option((), "further solids, `name=FILE` each, in metres")
    resolution: Annotated[int, Ge(4), Le(400)] = option(
        32, "lattice spacings along the longest side, at first [1]"
    )
    accuracy: Annotated[float, Ge(0.0), Le(1.0)] = option(
        0.01,
        "expected error down to which resolutions are raised, of thick solids a fifth of it; "
        "0 leaves them [1]",
    )
    levels: Annotated[int, Ge(0), Le(4)] = option(
        3, "sizes of each discretisation, coarsest first; 0 leaves out errors over size [1]"
    )
    bounds_resolution: Annotated[int, Ge(8), Le(400)] = option(
        32, "finest lattice on which frequencies below the references are sought [1]"
    )


SECTIONS = {"thin_walls": ThinWallsSection}
LIMITS = {
    "measure_thin_walls": JobLimits("all solids of the study of thin walls", 16000, 360),
    "bound_thin_walls": JobLimits("all lattices of the study of thin walls", 8000, 180),
}
