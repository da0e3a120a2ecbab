"""Contact of two elastic solids by Hertz: how long a bounce lasts, how stiff a contact is.

K. L. Johnson, Contact Mechanics (1985), sections 4.2 and 11.4.  The solids are as if round where
they touch, of one effective radius 1 / R = 1 / R1 + 1 / R2, and give way by one effective modulus
1 / E = (1 - nu1^2) / E1 + (1 - nu2^2) / E2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BOUNCE = 2.8683
"""2 (15 / 16)^(2/5) times the integral of (1 - x^(5/2))^(-1/2) from 0 to 1."""


def compliance(young: Array | float, poisson: float) -> Array:
    """What a solid contributes to 1 / E [1/Pa], of its modulus [Pa] and Poisson's ratio."""
    return np.asarray((1.0 - poisson**2) / young)


def bounce_seconds(mass: float, radius: float, modulus: float, speed: float) -> float:
    """How long two solids touch that strike each other [s].

    Parameters
    ----------
    mass : float [kg]
        Effective: 1 / m = 1 / m1 + 1 / m2.
    radius, modulus : float [m], [Pa]
        Effective.
    speed : float [m/s]
        At which they approach each other.

    Examples
    --------
    A steel ball of 10 mm radius that falls on a steel block at 1 m/s:

    >>> ball = 4.0 / 3.0 * np.pi * 0.01**3 * 7850.0
    >>> f"{1e6 * bounce_seconds(ball, 0.01, 2.0e11 / (1.0 - 0.29**2) / 2.0, 1.0):.0f} us"
    '71 us'
    """
    return float(BOUNCE * (mass**2 / (radius * modulus**2 * speed)) ** 0.2)


def approach(force: Array, radius: float, modulus: float) -> Array:
    """How far two solids give way [m] that are pressed together by a force [N]."""
    return np.asarray((0.75 * force / (modulus * np.sqrt(radius))) ** (2.0 / 3.0))


def stiffness(force: Array, radius: float, modulus: float) -> Array:
    """Force per way [N/m] about a contact that is pressed by a force [N]."""
    return np.asarray(np.cbrt(6.0 * modulus**2 * radius * force))


def patch_radius(force: Array, radius: float, modulus: float) -> Array:
    """Radius of the circle in which the solids touch [m]."""
    return np.asarray(np.cbrt(0.75 * force * radius / modulus))
