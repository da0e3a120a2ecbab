"""Solids with closed forms, as quadratures that are exact for polynomials."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import legendre
from scipy.special import roots_jacobi

from carillon.arrays import Array

Sides = tuple[float, float, float]
Degrees = tuple[int, int, int]


@dataclass(frozen=True)
class Domain:
    """Quadrature over a solid about the origin that is symmetric in the three planes."""

    points: Array
    weights: Array
    """(q, 3) [m] and (q,) [m^3]; no point lies in one of the planes."""
    sides: Sides
    """Of its bounding box [m]."""

    def octant(self) -> Domain:
        """The same of functions that are even in each coordinate, from an eighth of the points."""
        inside = (self.points > 0.0).all(axis=1)
        return Domain(self.points[inside], 8.0 * self.weights[inside], self.sides)


def box(sides: Sides, degrees: Degrees) -> Domain:
    """Parallelepiped, exact for products of two polynomials of these degrees.

    Examples
    --------
    >>> domain = box((1.0, 2.0, 3.0), (2, 2, 2))
    >>> bool(np.isclose(domain.weights @ domain.points[:, 0] ** 4, 0.075))
    True
    """
    (x, u), (y, v), (z, w) = (legendre.leggauss(_points(degree)) for degree in degrees)
    grid = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
    return _stretched(grid, np.einsum("i,j,k->ijk", u, v, w).ravel(), sides)


def cylinder(sides: Sides, degrees: Degrees, bore: float = 0.0) -> Domain:
    """Elliptic cylinder along z, or a tube whose radii have the ratio `bore`; exact likewise.

    Examples
    --------
    >>> tube = cylinder((2.0, 2.0, 1.0), (2, 2, 2), bore=0.5)
    >>> bool(np.isclose(tube.weights.sum(), 0.75 * np.pi))
    True
    """
    degree = max(degrees[:2])
    radii, of_radii = _radial(degree, bore, power=1)
    directions, of_angles = _circle(degree)
    across = (radii[:, None, None] * directions).reshape(-1, 2)
    z, of_z = legendre.leggauss(_points(degrees[2]))
    points = np.column_stack([np.repeat(across, len(z), axis=0), np.tile(z, len(across))])
    weights = np.einsum("i,j,k->ijk", of_radii, of_angles, of_z).ravel()
    return _stretched(points, weights, sides)


def ellipsoid(sides: Sides, degrees: Degrees, bore: float = 0.0) -> Domain:
    """Ellipsoid, or a shell between similar ones whose radii have the ratio `bore`; exact likewise.

    Examples
    --------
    >>> domain = ellipsoid((2.0, 2.0, 2.0), (2, 2, 2))
    >>> bool(np.isclose(domain.weights @ domain.points[:, 2] ** 4, 4.0 * np.pi / 35.0))
    True
    """
    degree = max(degrees)
    radii, of_radii = _radial(degree, bore, power=2)
    heights, of_heights = legendre.leggauss(_points(degree))
    directions, of_angles = _circle(degree)
    across = np.sqrt(1.0 - heights**2)[:, None, None] * directions
    sphere = np.dstack([across, np.broadcast_to(heights[:, None], across.shape[:2])])
    points = (radii[:, None, None, None] * sphere).reshape(-1, 3)
    weights = np.einsum("i,j,k->ijk", of_radii, of_heights, of_angles).ravel()
    return _stretched(points, weights, sides)


def _points(degree: int) -> int:
    """Gauss points for products of two polynomials of that degree; even, so that none is at 0."""
    return degree + 1 + (degree + 1) % 2


def _radial(degree: int, bore: float, power: int) -> tuple[Array, Array]:
    """Radii in [bore, 1] and weights times a power of the radius."""
    if bore:
        radii, weights = legendre.leggauss(degree + 1 + power)
        half = 0.5 * (1.0 - bore)
        radii = bore + half * (radii + 1.0)
        return radii, half * weights * radii**power
    radii, weights = roots_jacobi(degree + 1, 0.0, float(power))
    return 0.5 * (radii + 1.0), weights / 2.0 ** (power + 1)


def _circle(degree: int) -> tuple[Array, Array]:
    """Directions (n, 2) and weights that are exact for trigonometric polynomials of twice that."""
    count = 4 * (degree // 2 + 1)
    angles = 2.0 * np.pi * (np.arange(count) + 0.5) / count
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    return directions, np.full(count, 2.0 * np.pi / count)


def _stretched(points: Array, weights: Array, sides: Sides) -> Domain:
    """From a solid within [-1, 1]^3 to that of these sides."""
    half = 0.5 * np.array(sides)
    return Domain(points * half, weights * half.prod(), sides)
