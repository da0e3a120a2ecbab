"""Points of contact between bodies, recorded in every step of the simulation."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from carillon.arrays import Array, Integers


@dataclass(frozen=True)
class ContactPoints:
    """c points of contact.

    Attributes
    ----------
    steps : (c,)
        Number of the step.
    pairs : (c, 2)
        Numbers of the two bodies; the second one may be `sound.scenes.performance.GROUND`.
    positions : (c, 3) [m]
        Positions in the scene.
    places : (c, 2, 3) [m]
        Positions in the own axes of each of the two bodies.
    normals : (c, 3)
        Unit vectors from the second into the first body.
    forces : (c, 3) [N]
        Forces on the first body, in the axes of the scene.
    own_forces : (c, 2, 3) [N]
        Forces on each body, in its own axes.
    velocities : (c, 3) [m/s]
        Velocities of the first body's point relative to the second one's.
    turning : (c,) [rad/s]
        Angular speeds of rolling.
    masses : (c,) [kg]
        Effective masses for an impulse along the normal.
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
