"""Decay of modes by what the regions of a solid lose: Rayleigh damping of each.

To first order in the damping, a mode of a solid whose regions have coefficients alpha_r and beta_r
decays by

    d = 1/2 sum_r (alpha_r m_r + beta_r omega^2 s_r)

with the shares m_r of its mass and s_r of its strain energy in the regions (modal strain energy
method; Johnson and Kienholz, AIAA Journal 20, 1982). Springs of supports lose nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array
from carillon.fem.energies import energy_shares
from carillon.fem.model import Solid
from solver.response.response import Damping


@dataclass(frozen=True)
class Dissipation:
    """Where modes lose energy."""

    coefficients: Array
    """(g, 2) Rayleigh's coefficients of mass [1/s] and of stiffness [s] that there are."""
    mass: Array
    stiffness: Array
    """(k, g) shares of the regions with these in the mass and in the strain energy of modes."""

    def decay_per_second(self, eigenvalues: Array) -> Array:
        """Rates (k,) at which the modes decay where their eigenvalues are these [rad^2/s^2]."""
        alpha, beta = self.coefficients.T
        return np.asarray(0.5 * (self.mass @ alpha + eigenvalues * (self.stiffness @ beta)))


def is_known(model: Solid) -> bool:
    """Whether the damping of all regions is known."""
    return None not in model.regions.damping


def dissipation(model: Solid, eigenvalues: Array, modes: Array) -> Dissipation:
    """What each of some elastic modes (n_dofs, k), mass-normalised, loses, and where.

    Regions whose damping is not known have the default of `Damping`.
    """
    unknown = Damping()
    pairs = [
        (unknown.mass_per_second, unknown.stiffness_seconds) if pair is None else pair
        for pair in model.regions.damping
    ]
    coefficients, group = np.unique(np.array(pairs), axis=0, return_inverse=True)
    return Dissipation(coefficients, *energy_shares(model, eigenvalues, modes, group.ravel()))


def decays(model: Solid, eigenvalues: Array, modes: Array, damping: Damping | None = None) -> Array:
    """Rates (k,) [1/s] at which elastic modes (n_dofs, k) with these eigenvalues decay.

    By the `damping` given, or that of the solid, or the default of `Damping`.
    """
    if damping is None:
        known = set(model.regions.damping)
        if len(known) > 1:
            return dissipation(model, eigenvalues, modes).decay_per_second(eigenvalues)
        damping = Damping(*(model.damping or ()))
    return damping.decay_per_second(eigenvalues)
