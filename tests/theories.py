"""Frequencies by theories that share nothing with the references of the product (test support)."""

from collections.abc import Callable

import numpy as np
from scipy.optimize import brentq
from scipy.special import spherical_jn


def sphere_frequencies(
    radius: float, young: float, poisson: float, density: float, highest: float
) -> np.ndarray:
    """Frequencies [Hz] of a free sphere up to a highest one, each as often as it occurs.

    Torsional and spheroidal modes of Lamb (1882): of degree l there are 2 l + 1.
    """
    shear = young / (2.0 * (1.0 + poisson))
    slow = np.sqrt(shear / density)
    ratio = np.sqrt((1.0 - 2.0 * poisson) / (2.0 * (1.0 - poisson)))
    end = 2.0 * np.pi * highest * radius / slow
    found: list[float] = []
    for degree in range(int(end) + 3):
        for condition in (_torsional, _spheroidal):
            roots = _roots(lambda x, of=condition, n=degree: of(n, x, ratio), end)
            found += (2 * degree + 1) * roots
    return np.sort(found) * slow / (2.0 * np.pi * radius)


def _torsional(degree: int, x: float, ratio: float) -> float:
    """Shear stress on the surface of a torsional mode, x = omega radius / shear wave speed."""
    if degree == 0:
        return 1.0
    return (degree - 1) * spherical_jn(degree, x) - x * spherical_jn(degree + 1, x)


def _spheroidal(degree: int, x: float, ratio: float) -> float:
    """Determinant of radial and tangential stress of both waves on the surface."""
    n, y = degree, ratio * x

    def pair(z: float) -> tuple[float, float]:
        return spherical_jn(n, z), z * spherical_jn(n + 1, z)

    (a, da), (b, db) = pair(y), pair(x)
    radial = (n * (n - 1) - 0.5 * x**2) * a + 2.0 * da
    if n == 0:
        return radial
    radial_shear = n * (n + 1) * ((n - 1) * b - db)
    tangential = (n - 1) * a - da
    tangential_shear = (n**2 - 1 - 0.5 * x**2) * b + db
    return radial * tangential_shear - radial_shear * tangential


def _roots(function: Callable[[float], float], end: float) -> list[float]:
    grid = np.linspace(0.5, end, 400)
    values = np.array([function(x) for x in grid])
    changes = np.flatnonzero(values[:-1] * values[1:] < 0.0)
    return [float(brentq(function, grid[i], grid[i + 1], xtol=1e-13)) for i in changes]


def ring_frequencies(
    radius: float, section: float, young: float, density: float, count: int
) -> np.ndarray:
    """In-plane bending frequencies [Hz] of a thin ring of square section, each occurring twice.

    Inextensional, by Love (1927), section 293.
    """
    n = np.arange(2, 2 + count)
    stiffness = young * section**2 / 12.0 / density / radius**4
    return np.sqrt(stiffness * (n * (n**2 - 1)) ** 2 / (n**2 + 1)) / (2.0 * np.pi)


def plate_frequencies(side: float, thickness: float, young: float, density: float) -> np.ndarray:
    """The lowest four [Hz] of a free square thin plate of Poisson's ratio 0.3.

    Frequency parameters of Hurlebaus, Gaul and Wang (2001).
    """
    parameters = np.array([13.4682, 19.5961, 24.2702, 34.8009])
    bending = young * thickness**2 / (12.0 * (1.0 - 0.3**2)) / density
    return parameters * np.sqrt(bending) / (2.0 * np.pi * side**2)


def rod_frequencies(
    length: float, radius: float, young: float, poisson: float, density: float
) -> np.ndarray:
    """Bending frequencies [Hz] of a free round rod, one of each pair, by Timoshenko's theory.

    Deflections and rotations are polynomials (Rayleigh and Ritz); Cowper's shear factor (1966).
    """
    from numpy.polynomial import legendre
    from scipy.linalg import eigh

    degree = 12
    x, weights = legendre.leggauss(2 * degree)
    values = legendre.legvander(x, degree)
    units = np.eye(degree + 1)
    slopes = np.stack([legendre.legval(x, legendre.legder(unit)) for unit in units], axis=1)
    slopes = slopes * (2.0 / length)
    area, moment = np.pi * radius**2, np.pi * radius**4 / 4.0
    factor = 6.0 * (1.0 + poisson) / (7.0 + 6.0 * poisson)
    shear = factor * area * young / (2.0 * (1.0 + poisson))
    none = np.zeros_like(values)
    deflection, rotation = np.hstack([values, none]), np.hstack([none, values])
    bent, sheared = np.hstack([none, slopes]), np.hstack([slopes, -values])

    def summed(functions: np.ndarray) -> np.ndarray:
        return (functions.T * (weights * length / 2.0)) @ functions

    stiffness = young * moment * summed(bent) + shear * summed(sheared)
    mass = density * (area * summed(deflection) + moment * summed(rotation))
    return np.sqrt(eigh(stiffness, mass, eigvals_only=True)[2:]) / (2.0 * np.pi)
