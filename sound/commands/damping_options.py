"""Whose dampings a design sounds with, for commands that let it sound."""

from __future__ import annotations

from dataclasses import dataclass

from carillon.command_line.options import option


@dataclass(frozen=True)
class DampingOptions:
    """Whose dampings sound."""

    damping_from: str | None = option(
        None,
        "dampings of the clips, or those that loss factors of the material make, not as the "
        "project says",
        choices=("clips", "material"),
    )
