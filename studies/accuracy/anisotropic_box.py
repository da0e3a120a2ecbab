"""Frequencies of boxes of any elasticity, or of layers, by Rayleigh-Ritz with products: no mesh.

It shares nothing with `studies.accuracy.ritz`: integrals over a box are products of integrals along
its sides. Visscher et al. 1991 take powers of x, y and z; Legendre's polynomials span the same
space and stay independent at high degrees. Along z, functions have kinks between layers.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import NamedTuple

import numpy as np
import scipy.linalg as la
from numpy.polynomial import legendre

from carillon.arrays import Array, Index
from studies.accuracy.domains import Degrees, Sides

ROWS = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])
"""Row of the strain xx, yy, zz, xy, yz, zx that the derivative of a displacement is part of."""
AXIS_PAIRS = tuple(product(range(3), repeat=2))


class PointMass(NamedTuple):
    """A mass [kg] at a point (3,) [m] from the middle of the box."""

    mass: float
    point: Sequence[float]


class BoxLayer(NamedTuple):
    """A layer of a box: its thickness along z [m], elasticity (6, 6) [Pa] and density [kg/m^3]."""

    thickness: float
    elasticity: Array
    density: float


def box_eigenvalues(
    sides: Sides,
    degrees: Degrees,
    elasticity: Array,
    density: float,
    clamped: bool = False,
    masses: Sequence[PointMass] = (),
) -> Array:
    """All eigenvalues [rad^2/s^2] of a uniform box, see `layered_eigenvalues`.

    Parameters
    ----------
    sides
        Of the box [m].
    elasticity
        (6, 6) [Pa], symmetric; engineering shear strains, in the order xx, yy, zz, xy, yz, zx.
    density
        Mass density [kg/m^3].

    Examples
    --------
    >>> from carillon.fem.elasticity import elasticity_matrix
    >>> values = box_eigenvalues((0.1, 0.1, 0.1), (4, 4, 4), 1e9 * elasticity_matrix(), 1000.0)
    >>> len(values), int(np.count_nonzero(values > 1.0))
    (105, 99)
    """
    x, y, z = sides
    return layered_eigenvalues((x, y), degrees, [BoxLayer(z, elasticity, density)], clamped, masses)


def layered_eigenvalues(
    sides: tuple[float, float],
    degrees: Degrees,
    layers: Sequence[BoxLayer],
    clamped: bool = False,
    masses: Sequence[PointMass] = (),
) -> Array:
    """All eigenvalues [rad^2/s^2] of a box of layers, those of rigid motions first.

    They are bounds from above, in a space of products of polynomials of degrees i, j, k with
    ``i / I + j / J + k / K <= 1``; those along z are continuous, and polynomials in each layer.

    Parameters
    ----------
    sides
        Along x and y [m].
    degrees
        I, J, K.
    layers
        From the least z on.
    clamped
        Whether the face of least z does not move.
    masses
        Points of the box that weigh something.
    """
    (x, y), (i, j, k) = sides, degrees
    lines = [_plain_line(x, i), _plain_line(y, j), _layered_line(layers, k, clamped)]
    powers = _powers(lines, degrees)
    count = powers.shape[1]

    def products(left: int | None, right: int | None, layer: int) -> Array:
        """Integrals (n, n) of all pairs of functions, of their derivatives along these axes."""
        tables = [
            line.integrals[int(left == axis), int(right == axis), layer if axis == 2 else 0]
            for axis, line in enumerate(lines)
        ]
        return np.prod([t[np.ix_(p, p)] for t, p in zip(tables, powers)], axis=0)

    K = np.zeros((3, count, 3, count))
    M = np.zeros((count, count))
    for number, layer in enumerate(layers):
        for a, b in AXIS_PAIRS:
            form = products(a, b, number)
            for p, q in AXIS_PAIRS:
                K[p, :, q] += layer.elasticity[ROWS[p, a], ROWS[q, b]] * form
        M += layer.density * products(None, None, number)
    for mass, point in masses:
        values = [line.values_at(place) for line, place in zip(lines, point)]
        at = np.prod([value[power] for value, power in zip(values, powers)], axis=0)
        M += mass * np.outer(at, at)
    # In a basis that is orthonormal by the mass: the same for each displacement.
    lower = la.cholesky(M, lower=True)
    for p, q in AXIS_PAIRS:
        half = la.solve_triangular(lower, K[p, :, q], lower=True)
        K[p, :, q] = la.solve_triangular(lower, half.T, lower=True).T
    return np.asarray(la.eigvalsh(K.reshape(3 * count, 3 * count)))


def box_frequencies(
    sides: Sides, degrees: Degrees, elasticity: Array, density: float, count: int
) -> Array:
    """The lowest elastic frequencies (count,) [Hz] of a free box, see `box_eigenvalues`."""
    values = box_eigenvalues(sides, degrees, elasticity, density)
    return np.asarray(np.sqrt(values[6 : 6 + count]) / (2.0 * np.pi))


class _Line(NamedTuple):
    """Functions along one side of the box, in parts."""

    ends: Array
    """(p + 1,) of the parts, from the middle of the side [m]."""
    tables: Array
    """(p, d, n): Legendre's coefficients of each function in each part."""
    degrees: Index
    """(n,) of the functions, for the choice of products."""
    integrals: Array
    """[a, b] (2, 2, p, n, n): of products of functions (0) or derivatives (1) over each part."""

    def values_at(self, place: float) -> Array:
        """Values (n,) of the functions at a place from the middle [m]."""
        part = int(np.clip(np.searchsorted(self.ends, place) - 1, 0, len(self.tables) - 1))
        start, end = self.ends[part], self.ends[part + 1]
        inside = 2.0 * (place - start) / (end - start) - 1.0
        return np.asarray(legendre.legval(inside, self.tables[part]))


def _line(ends: Array, tables: Array, degrees: Index) -> _Line:
    x, weights = legendre.leggauss(tables.shape[1] + 1)
    halves = 0.5 * np.diff(ends)
    slopes = np.stack([legendre.legder(table, axis=0) for table in tables])
    both = [
        np.stack([legendre.legval(x, part) / half**order for part, half in zip(parts, halves)])
        for order, parts in enumerate((tables, slopes))
    ]
    integrals = np.array(
        [
            [np.einsum("p,q,pmq,pnq->pmn", halves, weights, left, right) for right in both]
            for left in both
        ]
    )
    return _Line(ends, tables, degrees, integrals)


def _plain_line(side: float, degree: int) -> _Line:
    """Legendre's polynomials, normalised."""
    numbers = np.arange(degree + 1)
    tables = np.diag(np.sqrt((2.0 * numbers + 1.0) / side))[None]
    return _line(np.array([-0.5, 0.5]) * side, tables, numbers)


def _layered_line(layers: Sequence[BoxLayer], degree: int, clamped: bool) -> _Line:
    """Continuous functions that are polynomials in each layer.

    One, ramps that rise from 0 to 1 in one layer and fall in the next, and bubbles of degree 2 and
    more that vanish outside of their layer. Without the one, all vanish where the first layer
    begins; they count as lower by a degree, as a factor that vanishes there is no choice.
    """
    ends = np.concatenate([[0.0], np.cumsum([layer.thickness for layer in layers])])
    parts = len(layers)
    tables, numbers = [], []

    def add(number: int, *shares: tuple[int, dict[int, float]]) -> None:
        table = np.zeros((parts, degree + 1 + clamped))
        for part, coefficients in shares:
            table[part, list(coefficients)] = list(coefficients.values())
        tables.append(table)
        numbers.append(number - clamped)

    if not clamped:
        add(0, *((part, {0: 1.0}) for part in range(parts)))
    for part in range(parts):
        falls = [(part + 1, {0: 0.5, 1: -0.5})] if part + 1 < parts else []
        add(1, (part, {0: 0.5, 1: 0.5}), *falls)
        for power in range(2, degree + 1 + clamped):
            size = 1.0 / np.sqrt(4.0 * power - 2.0)
            add(power, (part, {power: size, power - 2: -size}))
    middle = 0.5 * ends[-1]
    return _line(ends - middle, np.stack(tables, axis=-1), np.array(numbers))


def _powers(lines: Sequence[_Line], degrees: Degrees) -> Index:
    """Numbers (3, n) of the functions along each side that the products consist of."""
    shares = [line.degrees / degree for line, degree in zip(lines, degrees)]
    total = shares[0][:, None, None] + shares[1][:, None] + shares[2]
    return np.array(np.nonzero(total <= 1.0 + 1e-12))
