"""Hertz's theory of the contact of two elastic solids: duration of a bounce, stiffness, patch.

K. L. Johnson, Contact Mechanics (1985), sections 4.2 and 11.4.  The effective radius is
1 / R = 1 / R1 + 1 / R2, the effective modulus 1 / E = (1 - nu1^2) / E1 + (1 - nu2^2) / E2, the
effective mass 1 / m = 1 / m1 + 1 / m2.
"""

import numpy as np

from carillon.arrays import Array

BOUNCE = 2.8683
"""Factor of the duration of a bounce: 2 (15 / 16)^(2/5) times the integral of (1 - x^(5/2))^(-1/2)
from 0 to 1."""


def compliance(young: Array | float, poisson: Array | float) -> Array:
    """Part of a solid in 1 / E [1/Pa], from its Young's modulus [Pa] and Poisson's ratio."""
    return np.asarray((1.0 - poisson**2) / young)


def bounce_seconds(mass: float, radius: float, modulus: float, speed: float) -> float:
    """Duration [s] of the contact in an impact, by the effective mass [kg], radius [m] and modulus
    [Pa], and the speed of approach [m/s].

    Examples
    --------
    A steel ball of 10 mm radius that falls on a steel block at 1 m/s:

    >>> ball = 4.0 / 3.0 * np.pi * 0.01**3 * 7850.0
    >>> f"{1e6 * bounce_seconds(ball, 0.01, 2.0e11 / (1.0 - 0.29**2) / 2.0, 1.0):.0f} us"
    '71 us'
    """
    return float(BOUNCE * (mass**2 / (radius * modulus**2 * speed)) ** 0.2)


def approach(force: Array, radius: float, modulus: float) -> Array:
    """Approach [m] of two solids that are pressed together by a force [N]."""
    return np.asarray((0.75 * force / (modulus * np.sqrt(radius))) ** (2.0 / 3.0))


def stiffness(force: Array, radius: float, modulus: float) -> Array:
    """Stiffness [N/m] of a contact under a force [N]."""
    return np.asarray(np.cbrt(6.0 * modulus**2 * radius * force))


def patch_radius(force: Array, radius: float, modulus: float) -> Array:
    """Radius [m] of the circle of contact under a force [N]."""
    return np.asarray(np.cbrt(0.75 * force * radius / modulus))
