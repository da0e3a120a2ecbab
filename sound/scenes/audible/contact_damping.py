"""Damping of a body's modes by the bodies that it touches.

A contact is a spring with a dashpot.  A dashpot c along the unit vector u takes the power
c (u . v)^2 from a body that moves at the velocity v there, which adds c (u . U_k)^2 / 2 to the
damping of a mode U_k.
"""

from __future__ import annotations

import numpy as np

from carillon.arrays import Array
from sound.scenes.hertz import stiffness

DAMPING_RATIO = 0.1
"""Damping ratio of a contact: an assumption that stands for all losses there."""
MOST_DAMPED = 0.05
"""Greatest damping that contacts add to a mode, over the mode's angular frequency."""
_TINY = 1e-12


def dashpot(forces: Array, radius: float, modulus: float, mass: float) -> Array:
    """Dashpots [N s/m] of contacts under forces [N].

    Parameters
    ----------
    radius, modulus, mass : float [m], [Pa], [kg]
        Effective radius, modulus and mass, see `sound.scenes.hertz`.
    """
    springs = stiffness(forces, radius, modulus)
    return np.asarray(2.0 * DAMPING_RATIO * np.sqrt(springs * mass))


def motion_along(motion: Array, forces: Array) -> Array:
    """Components (p, K) along forces (p, 3) of the motion (p, 3, K) of points in each mode."""
    sizes = np.linalg.norm(forces, axis=1, keepdims=True)
    return np.asarray(np.einsum("pik,pi->pk", motion, forces / np.maximum(sizes, _TINY)))


def greatest_damping(frequencies: Array) -> Array:
    """Greatest damping (K,) [1/s] that contacts add to modes at frequencies (K,) [Hz]."""
    return MOST_DAMPED * 2.0 * np.pi * frequencies
