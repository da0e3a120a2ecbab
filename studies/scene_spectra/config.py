"""Keys of the study in the configuration."""

from typing import Annotated

from annotated_types import Ge, Le

from carillon.parameters import option, parameters


@parameters
class SceneSpectraSection:
    """One scene of rigid bodies, heard by the truth's modes and by coarse ones (Fig. 13); target
    scene_spectra renders it.
    """

    resolution: Annotated[int, Ge(8), Le(4096)] = option(
        28, "voxels along the longest side of every solid [1]"
    )
    modes: Annotated[int, Ge(8), Le(1000)] = option(
        66, "modes of every solid, rigid ones included [1]"
    )
    seconds: Annotated[float, Ge(0.3), Le(60)] = option(3.0, "how long the scene lasts [s]")


SECTIONS = {"scene_spectra": SceneSpectraSection}
