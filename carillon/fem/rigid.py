"""Mass, centre and inertia of a solid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array
from carillon.fem.model import Solid


@dataclass(frozen=True)
class MassProperties:
    """A solid as a rigid body."""

    mass: float
    """Mass of the whole solid [kg]."""
    centre: Array
    """(3,) centre of mass [m]."""
    moments: Array
    """(3,) principal moments of inertia about it [kg m^2], ascending."""
    axes: Array
    """(3, 3) rotation whose columns are the principal axes."""


def mass_properties(model: Solid) -> MassProperties:
    """Integrals of the density over the solid; exact, as elements have all linear functions."""
    corners = model.mesh.nodes[model.connectivity]
    nodal = model.nodal_mass()
    mass = float(nodal.sum())
    centre = np.einsum("cab,cbi->i", nodal, corners) / mass
    arms = corners - centre
    second = np.einsum("cai,cab,cbj->ij", arms, nodal, arms)
    moments, axes = np.linalg.eigh(np.trace(second) * np.eye(3) - second)
    axes[:, 0] *= np.sign(np.linalg.det(axes))
    return MassProperties(mass, centre, moments, axes)
