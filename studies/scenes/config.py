"""Keys of the study in the configuration, and what its jobs take."""

from typing import Annotated, Literal

from annotated_types import MaxLen, MinLen

from carillon.parameters import option, parameters
from workflow.configuration.resources import JobLimits
from workflow.configuration.section import Line, Several


@parameters
class ScenesSection:
    """Scenes of solids that fall, roll and strike each other, each with sound, film and page;
    target scenes plays them.
    """

    examples: Several[Literal["falling", "row", "bowled"]] = option(
        ("falling", "row", "bowled"),
        "names of the scenes; ten designs of sound.examples that fall on a floor (Fig. 16), a row "
        "of bars that a ball strikes, the design of the chord, or of the first example where there "
        "is none, bowled at ten pins",
    )
    notes: Annotated[Line, MinLen(2), MaxLen(400)] = option(
        "E6 E6 F6 G6 G6 F6 E6 D6 C6 C6 D6 E6 E6 D6 D6",
        "names of the notes of the row of bars, one to 64, such as C6 F#6 Bb6, the default begins "
        "the Ode to Joy",
    )


SECTIONS = {"scenes": ScenesSection}
LIMITS = {"play_scene": JobLimits("a scene, its film and its page", 4000, 60)}
