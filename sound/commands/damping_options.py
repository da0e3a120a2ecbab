"""Whose dampings a design sounds with, for commands that let it sound."""

from __future__ import annotations

from carillon.parameters import option, parameters
from sound.project.settings import Dampings


@parameters
class DampingOptions:
    """Whose dampings sound."""

    damping_from: Dampings | None = option(
        None,
        "dampings of the clips, or those that loss factors of the material make, not as the "
        "project says",
    )
