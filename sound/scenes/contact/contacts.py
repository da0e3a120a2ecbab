"""What touched what, step by step, as the engine of rigid bodies tells it."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.integer]


@dataclass(frozen=True)
class ContactPoints:
    """Points of contact, one after the other; c of them.

    Attributes
    ----------
    steps : (c,)
        Number of the step in which each was.
    pairs : (c, 2)
        Numbers of the objects; the second one may be `sound.scenes.performance.GROUND`.
    positions : (c, 3) [m]
        In the scene.
    places : (c, 2, 3) [m]
        In each object's own axes, from its centre of mass.
    normals : (c, 3)
        Unit vectors from the second into the first object.
    forces : (c, 3) [N]
        On the first object, in the axes of the scene.
    own_forces : (c, 2, 3) [N]
        On each object, in its own axes.
    velocities : (c, 3) [m/s]
        Of the first object's point in the second one's eyes.
    turning : (c,) [rad/s]
        How fast one rolls on the other.
    masses : (c,) [kg]
        Effective, for a push along the normal.
    """

    steps: Integers
    pairs: Integers
    positions: Array
    places: Array
    normals: Array
    forces: Array
    own_forces: Array
    velocities: Array
    turning: Array
    masses: Array

    def __getitem__(self, chosen: Integers | slice) -> ContactPoints:
        return ContactPoints(*(getattr(self, field.name)[chosen] for field in fields(self)))

    def __len__(self) -> int:
        return len(self.steps)

    @property
    def pressures(self) -> Array:
        """Normal force (c,) [N] at each point."""
        return np.einsum("ci,ci->c", self.forces, self.normals)
