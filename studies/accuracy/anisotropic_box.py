"""Frequencies of boxes of any elasticity by Rayleigh-Ritz with products of polynomials: no mesh.

It shares nothing with `studies.accuracy.ritz`: integrals over a box are products of integrals along
its sides. Visscher et al. 1991 take powers of x, y and z; Legendre's polynomials span the same
space and stay independent at high degrees.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import scipy.linalg as la
from numpy.polynomial import legendre

from carillon.arrays import Array
from studies.accuracy.domains import Degrees, Sides

ROWS = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])
"""Row of the strain xx, yy, zz, xy, yz, zx that the derivative of a displacement is part of."""
AXIS_PAIRS = tuple(product(range(3), repeat=2))


class PointMass(NamedTuple):
    """A mass [kg] at a point (3,) [m] from the middle of the box."""

    mass: float
    point: Sequence[float]


def box_eigenvalues(
    sides: Sides,
    degrees: Degrees,
    elasticity: Array,
    density: float,
    clamped: bool = False,
    masses: Sequence[PointMass] = (),
) -> Array:
    """All eigenvalues [rad^2/s^2] of a box in a space of polynomials, those of rigid motions first.

    They are bounds from above. The space holds the products of powers i, j, k with
    ``i / I + j / J + k / K <= 1``, of a `clamped` box times the distance from the held face.

    Parameters
    ----------
    sides
        Of the box [m].
    degrees
        I, J, K.
    elasticity
        (6, 6) [Pa], symmetric; engineering shear strains, in the order xx, yy, zz, xy, yz, zx.
    density
        Mass density [kg/m^3].
    clamped
        Whether the face of least z does not move.
    masses
        Points of the box that weigh something.

    Examples
    --------
    >>> from carillon.fem.element import elasticity_matrix
    >>> values = box_eigenvalues((0.1, 0.1, 0.1), (4, 4, 4), 1e9 * elasticity_matrix(), 1000.0)
    >>> len(values), int(np.count_nonzero(values > 1.0))
    (105, 99)
    """
    powers = np.array([p for p in np.ndindex(*np.add(degrees, 1)) if _within(p, degrees)]).T
    lines = [
        _Line.of(side, degree, held)
        for side, degree, held in zip(sides, degrees, (False, False, clamped))
    ]

    def products(left: int | None, right: int | None) -> Array:
        """Integrals (n, n) of all pairs of functions, of their derivatives along these axes."""
        return np.prod(
            [
                line.integrals[int(left == axis)][int(right == axis)][np.ix_(index, index)]
                for axis, (line, index) in enumerate(zip(lines, powers))
            ],
            axis=0,
        )

    count = powers.shape[1]
    forms = {pair: products(*pair) for pair in AXIS_PAIRS}
    K = np.zeros((3, count, 3, count))
    for i, j in AXIS_PAIRS:
        for a, b in AXIS_PAIRS:
            K[i, :, j] += elasticity[ROWS[i, a], ROWS[j, b]] * forms[a, b]
    scalar = density * products(None, None)
    for mass, point in masses:
        values = np.prod(
            [line.values_at(x)[index] for line, x, index in zip(lines, point, powers)], axis=0
        )
        scalar += mass * np.outer(values, values)
    # In a basis that is orthonormal by the mass: the same for each displacement.
    lower = la.cholesky(scalar, lower=True)
    for i, j in AXIS_PAIRS:
        half = la.solve_triangular(lower, K[i, :, j], lower=True)
        K[i, :, j] = la.solve_triangular(lower, half.T, lower=True).T
    return np.asarray(la.eigvalsh(K.reshape(3 * count, 3 * count)))


def box_frequencies(
    sides: Sides, degrees: Degrees, elasticity: Array, density: float, count: int
) -> Array:
    """The lowest elastic frequencies (count,) [Hz] of a free box, see `box_eigenvalues`."""
    values = box_eigenvalues(sides, degrees, elasticity, density)
    return np.asarray(np.sqrt(values[6 : 6 + count]) / (2.0 * np.pi))


def _within(powers: Sequence[int], degrees: Degrees) -> bool:
    return sum(power / degree for power, degree in zip(powers, degrees)) <= 1.0 + 1e-12


class _Line(NamedTuple):
    """Functions along one side, from -1 to 1: polynomials, times 1 + x if the side is `held`."""

    side: float
    degree: int
    held: bool
    integrals: list[list[Array]]
    """[a][b] (d + 1, d + 1): of products of functions (0) or derivatives (1) along the side [m]."""

    @classmethod
    def of(cls, side: float, degree: int, held: bool) -> _Line:
        x, weights = legendre.leggauss(degree + 2)
        weights = 0.5 * side * weights
        both = [_functions(x, degree, held), _slopes(x, degree, held) * (2.0 / side)]
        integrals = [[(left.T * weights) @ right for right in both] for left in both]
        return cls(side, degree, held, integrals)

    def values_at(self, x: float) -> Array:
        """Values (d + 1,) of the functions at a place from the middle [m]."""
        return _functions(np.array([2.0 * x / self.side]), self.degree, self.held)[0]


def _functions(x: Array, degree: int, held: bool) -> Array:
    values = _legendre(x, degree)
    return (1.0 + x)[:, None] * values if held else values


def _slopes(x: Array, degree: int, held: bool) -> Array:
    slopes = legendre.legval(x, legendre.legder(np.diag(_norms(degree)), axis=0)).T
    return (1.0 + x)[:, None] * slopes + _legendre(x, degree) if held else np.asarray(slopes)


def _legendre(x: Array, degree: int) -> Array:
    """Values (q, d + 1) of Legendre's polynomials, normalised over -1 to 1."""
    return np.asarray(legendre.legvander(x, degree) * _norms(degree))


def _norms(degree: int) -> Array:
    return np.sqrt(np.arange(degree + 1) + 0.5)
