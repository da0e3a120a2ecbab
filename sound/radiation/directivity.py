"""Directivity: the pressure that modes radiate far away, by direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from carillon.arrays import Array, Complex

ORDERS_BEYOND = 4
"""Orders of harmonics beyond k R, the wave number times the radius of the solid."""


@dataclass(frozen=True)
class Directivity:
    """Pressure times distance of K modes in all directions, by spherical harmonics.

    A mode k whose coordinate moves at the velocity Re x_k, x_k = a_k exp(i omega_k t), is heard in
    the direction n with

        r p_k = Im( x_k  sum_j coefficients[k, j] Y_j(n) ).

    Attributes
    ----------
    coefficients : (K, (L + 1)^2) [Pa m / (kg^-1/2 N s)]
        Complex, of the real harmonics up to the order L, see `harmonics`.
    """

    coefficients: Complex

    @classmethod
    def uniform(cls, gains: Array) -> Self:
        """Modes of gains (K,) that sound alike in all directions."""
        return cls(np.asarray(gains, dtype=complex)[:, None])

    @classmethod
    def of_dipoles(cls, monopoles: Array, dipoles: Array) -> Self:
        """Modes that are heard by monopole + dipole . n, of monopoles (K,) and dipoles (K, 3)."""
        turned = dipoles[:, [1, 2, 0]] / np.sqrt(3.0)
        return cls(np.column_stack([monopoles, turned]).astype(complex))

    @property
    def order(self) -> int:
        """Highest order L of the harmonics."""
        return round(np.sqrt(self.coefficients.shape[1])) - 1

    @property
    def is_uniform(self) -> bool:
        """Whether all modes sound alike in all directions."""
        return not self.coefficients[:, 1:].any()

    @property
    def rms(self) -> Array:
        """Root of the mean of |r p_k|^2 (K,) over all directions."""
        return np.sqrt((np.abs(self.coefficients) ** 2).sum(axis=1))

    def times(self, factor: float) -> Self:
        """The same modes, louder by a factor."""
        return type(self)(factor * self.coefficients)

    def with_modes_after(self, other: Directivity) -> Self:
        """These K modes, and those of another directivity after its first K."""
        count, width = self.coefficients.shape
        beyond = other.coefficients[count:]
        total = np.zeros((count + len(beyond), max(width, beyond.shape[1])), dtype=complex)
        total[:count, :width] = self.coefficients
        total[count:, : beyond.shape[1]] = beyond
        return type(self)(total)

    def towards(self, directions: Array) -> Complex:
        """Pressure times distance (T, K) in directions (T, 3), unit vectors in the solid's axes."""
        return np.asarray(harmonics(self.order, directions) @ self.coefficients.T)


def order_of(size: float) -> int:
    """Order of the harmonics that the field of a solid of the size k R has."""
    return int(np.ceil(size)) + ORDERS_BEYOND


def harmonics(order: int, directions: Array) -> Array:
    """Real spherical harmonics (T, (L + 1)^2) up to an order L, in directions (T, 3).

    Their mean square over all directions is 1 (ambisonics' N3D), and they are sorted by l^2 + l + m
    (ACN); those of order 1 are sqrt(3) y, z and x.

    Examples
    --------
    >>> harmonics(1, np.array([[0.0, 0.0, 1.0]]))[0, [0, 2]].round(6).tolist()
    [1.0, 1.732051]
    """
    from scipy.special import sph_harm_y_all

    x, y, z = np.asarray(directions, dtype=float).T
    polar, around = np.arccos(np.clip(z, -1.0, 1.0)), np.arctan2(y, x)
    values = np.sqrt(4.0 * np.pi) * sph_harm_y_all(order, order, polar, around)
    real = np.empty((len(x), (order + 1) ** 2))
    for degree in range(order + 1):
        middle = degree**2 + degree
        real[:, middle] = values[degree, 0].real
        for m in range(1, degree + 1):
            turned = np.sqrt(2.0) * (-1.0) ** m * values[degree, m]
            real[:, middle + m], real[:, middle - m] = turned.real, turned.imag
    return real


def even_directions(order: int) -> tuple[Array, Array]:
    """Unit vectors (D, 3), and weights (D,) of sum 1, that integrate harmonics up to an order.

    Gauss's points in the height, and even steps around.
    """
    heights, weights = np.polynomial.legendre.leggauss(order // 2 + 1)
    turns = 2.0 * np.pi * np.arange(order + 1) / (order + 1)
    across = np.sqrt(1.0 - heights**2)
    directions = np.stack(
        [
            np.outer(across, np.cos(turns)),
            np.outer(across, np.sin(turns)),
            np.outer(heights, np.ones(len(turns))),
        ],
        axis=2,
    )
    shares = np.outer(weights / 2.0, np.full(len(turns), 1.0 / len(turns)))
    return directions.reshape(-1, 3), shares.ravel()
