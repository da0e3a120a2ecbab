"""The ground of a scene: a horizontal plane."""

from __future__ import annotations

from typing import NamedTuple

from sound.scenes.materials import NamedMaterial


class GroundPlane(NamedTuple):
    """The ground.

    Attributes
    ----------
    height : float [m] or None
        Its z; None if there is no ground.
    material
        What it is made of.
    """

    height: float | None
    material: NamedMaterial
