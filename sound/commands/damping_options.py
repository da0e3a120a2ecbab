"""Whose dampings a design sounds with, for commands that let it sound."""

from __future__ import annotations

from typing import Annotated

from carillon.parameters import OneOf, option, parameters


@parameters
class DampingOptions:
    """Whose dampings sound."""

    damping_from: Annotated[str, OneOf("clips", "material")] | None = option(
        None,
        "dampings of the clips, or those that loss factors of the material make, not as the "
        "project says",
    )
