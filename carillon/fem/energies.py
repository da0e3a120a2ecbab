"""Kinetic and strain energy of modes by the regions of a solid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from carillon.fem.elements import Elements
from carillon.fem.model import Solid

ENTRIES_AT_ONCE = 1 << 23
"""Numbers in the element matrices, and in the motion of their nodes, that are in memory at a
time."""


def energy_shares(
    model: Solid, eigenvalues: Array, modes: Array, group: NDArray[np.integer]
) -> tuple[Array, Array]:
    """Shares (k, g) of groups of regions in the mass, and in the stiffness, of modes.

    The mass of mass-normalised modes (n_dofs, k) is one, their stiffness the eigenvalue (k,)
    [rad^2/s^2], above zero. What supports hold belongs to no group.

    Parameters
    ----------
    group
        (r,) number of the group of each region.
    """
    free = model.with_supports(None)
    elements, count = free.elements, int(group.max()) + 1
    whole = _products(elements, free.connectivity, modes, mass=True)
    mass, stiffness = np.empty((2, modes.shape[1], count))
    for number in range(count):
        # The mass is linear in the densities.
        doubled = elements.regions.density * np.where(group == number, 2.0, 1.0)
        heavier = elements.with_regions(replace(elements.regions, density=doubled))
        mass[:, number] = _products(heavier, free.connectivity, modes, mass=True) - whole
        own = elements.with_young(elements.moduli_of(group == number))
        stiffness[:, number] = _products(own, free.connectivity, modes, mass=False) / eigenvalues
    return mass, stiffness


def _products(elements: Elements, nodes: NDArray[np.integer], modes: Array, *, mass: bool) -> Array:
    """u^T M u, or u^T K u, (k,) of modes (n_dofs, k)."""
    width, count = nodes.shape[1], modes.shape[1]
    at_once = max(1, ENTRIES_AT_ONCE // (3 * width * max(3 * width, count)))
    by_node = modes.reshape(-1, 3, count)
    total = np.zeros(count)
    for first in range(0, len(nodes), at_once):
        chosen = slice(first, first + at_once)
        motion = by_node[nodes[chosen]]
        if mass:
            local, matrices = motion.reshape(len(motion), width, -1), elements.nodal_mass(chosen)
        else:
            local, matrices = motion.reshape(len(motion), -1, count), elements.stiffness(chosen)
        total += (local * (matrices @ local)).reshape(-1, count).sum(axis=0)
    return total
