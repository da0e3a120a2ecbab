"""Damping of modes of a solid whose regions are damped differently."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np

from carillon.arrays import Array
from carillon.fem.elements import Elements
from carillon.fem.finite_cells.model import CellElements
from carillon.fem.model import Solid
from carillon.fem.regions import Damping as Coefficients
from carillon.fem.regions import Regions

NUMBERS_AT_ONCE = 1 << 22
"""Numbers in the matrices and motions of elements that are held at a time."""


@dataclass(frozen=True)
class ModalDamping:
    """Rayleigh damping of each mode, as `solver.response.response.Damping` is that of all."""

    mass_per_second: Array
    stiffness_seconds: Array
    """(k,) [1/s] and [s]."""

    def decay_per_second(self, eigenvalues: Array) -> Array:
        """Rates (k,) at which modes with these eigenvalues (k,) [rad^2/s^2] decay [1/s]."""
        return np.asarray(0.5 * (self.mass_per_second + self.stiffness_seconds * eigenvalues))


def damping_of_regions(
    model: Solid, eigenvalues: Array, modes: Array, coefficients: Sequence[Coefficients]
) -> ModalDamping:
    """Damping of elastic modes by what each region loses.

    With the damping matrix sum_r (alpha_r M_r + beta_r K_r) a mode u decays, to first order, at
    u^T C u / 2: the regions count by their shares of its mass and of its strain energy. Springs and
    masses that support the solid lose nothing.

    Parameters
    ----------
    eigenvalues, modes
        (k,) [rad^2/s^2] and (n_dofs, k) mass-normalised [kg^-1/2], without rigid ones.
    coefficients
        Those of mass [1/s] and of stiffness [s] of each row of the model's regions.
    """
    alpha, beta = np.array(coefficients, dtype=float).T
    if len(set(coefficients)) == 1 and model.supports is None:
        count = len(eigenvalues)
        return ModalDamping(np.full(count, alpha[0]), np.full(count, beta[0]))
    free = model.with_supports(None)
    # Weighted by one more than alpha, since no region may have no mass.
    shift = max(1.0, float(alpha.max()))
    dense = free.with_regions(_denser(free.regions, 1.0 + alpha / shift)).elements
    plain, soft = free.elements, _softer(free.elements, beta)
    connected = model.connectivity
    dofs = (3 * connected[:, :, None].astype(np.int64) + np.arange(3)).reshape(len(connected), -1)
    kinetic, elastic = np.zeros(len(eigenvalues)), np.zeros(len(eigenvalues))
    step = max(1, NUMBERS_AT_ONCE // (dofs.shape[1] * (dofs.shape[1] + modes.shape[1])))
    for first in range(0, len(dofs), step):
        chosen = slice(first, min(first + step, len(dofs)))
        moved = modes[dofs[chosen]]
        elastic += (moved * (soft.stiffness(chosen) @ moved)).sum(axis=(0, 1))
        mass = dense.nodal_mass(chosen) - plain.nodal_mass(chosen)
        by_node = moved.reshape(len(moved), -1, 3 * modes.shape[1])
        squares = (by_node * (mass @ by_node)).sum(axis=(0, 1))
        kinetic += squares.reshape(3, -1).sum(axis=0)
    return ModalDamping(shift * kinetic, elastic / eigenvalues)


def _denser(regions: Regions, factors: Array) -> Regions:
    return replace(regions, density=factors * regions.density)


def _softer(elements: Elements, factors: Array) -> Elements:
    """The same elements with the moduli of each region times a factor."""
    region = elements.law if isinstance(elements, CellElements) else cast(Any, elements).region
    own = factors[0] if region is None else factors[region]
    if isinstance(elements, CellElements) and region is not None:
        own = own[:, :, None]
    return elements.with_young(own * elements.young)
