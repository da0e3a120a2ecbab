"""Frequencies of free solids by Rayleigh-Ritz with polynomials over the whole solid: no mesh."""

from itertools import product

import numpy as np
import scipy.linalg as la
from numpy.polynomial import legendre

from carillon.arrays import Array
from carillon.fem.element import elasticity_matrix
from studies.accuracy.domains import Degrees, Domain

INDEPENDENT = 1e-9
"""Singular value, relative to the largest, below which polynomials are told apart by rounding."""


def free_eigenvalues(
    domain: Domain,
    degrees: Degrees,
    young: float | Array,
    poisson: float,
    density: float,
) -> Array:
    """All eigenvalues [rad^2/s^2] of a free solid in a space of polynomials, rigid motions first.

    They are bounds from above.  The space holds the products of powers i, j, k with
    ``i / I + j / J + k / K <= 1`` (Visscher et al. 1991 take I = J = K).  Orthogonal polynomials of
    the bounding box span it, made orthonormal over the solid.  A uniform solid that is symmetric in
    three planes has eight independent kinds of modes, which are computed one after the other.

    Parameters
    ----------
    domain
        The solid, exact for products of polynomials of these degrees.
    degrees
        I, J, K.
    young
        Young's modulus [Pa], or (q,) at the points of `domain`.

    Examples
    --------
    >>> from studies.accuracy.domains import box
    >>> values = free_eigenvalues(box((0.1, 0.1, 0.1), (4, 4, 4)), (4, 4, 4), 1e9, 0.25, 1000.0)
    >>> len(values), int(np.count_nonzero(values > 1.0))
    (105, 99)
    """
    first, second, third = (range(degree + 1) for degree in degrees)
    powers = [
        index
        for index in product(first, second, third)
        if sum(power / degree for power, degree in zip(index, degrees)) <= 1.0 + 1e-12
    ]
    if np.ndim(young):
        return _eigenvalues(domain, [powers] * 3, np.asarray(young), poisson, density)
    octant = domain.octant()
    moduli = np.full(octant.weights.shape, young)
    kinds = [_of_parities(powers, parities) for parities in product((0, 1), (0, 1), (0, 1))]
    eigenvalues = [_eigenvalues(octant, kind, moduli, poisson, density) for kind in kinds]
    return np.sort(np.concatenate(eigenvalues))


def _of_parities(powers: list[Degrees], parities: Degrees) -> list[list[Degrees]]:
    """Powers of each displacement for modes of one kind.

    A displacement is odd along its own axis where the others are even.
    """
    return [
        [
            power
            for power in powers
            if all((n + p + (a == axis)) % 2 == 0 for a, (n, p) in enumerate(zip(power, parities)))
        ]
        for axis in range(3)
    ]


def _eigenvalues(
    domain: Domain, powers: list[list[Degrees]], moduli: Array, poisson: float, density: float
) -> Array:
    gradients = [_orthonormal_gradients(domain, each) for each in powers]
    sizes = np.cumsum([0, *(each.shape[2] for each in gradients)])
    elasticity = elasticity_matrix(poisson)
    lame, shear = elasticity[0, 1], elasticity[3, 3]
    weights = domain.weights * moduli

    def form(i: int, a: int, j: int, b: int) -> Array:
        """Integral of E (d_a phi_m) (d_b phi_n), of displacements i and j."""
        return np.asarray(gradients[i][a].T @ (weights[:, None] * gradients[j][b]))

    K = np.empty((sizes[-1], sizes[-1]))
    for i, j in product(range(3), repeat=2):
        block = lame * form(i, i, j, j) + shear * form(i, j, j, i)
        if i == j:
            block += shear * sum(form(i, a, i, a) for a in range(3))
        K[sizes[i] : sizes[i + 1], sizes[j] : sizes[j + 1]] = block
    return np.asarray(la.eigvalsh(K / density))


def _orthonormal_gradients(domain: Domain, powers: list[Degrees]) -> Array:
    """Gradients (3, q, n) of scalar functions that are orthonormal over the solid."""
    half = 0.5 * np.array(domain.sides)
    highest = np.max(powers, axis=0)
    values, slopes = [], []
    for axis in range(3):
        coefficients = np.eye(highest[axis] + 1)
        x = domain.points[:, axis] / half[axis]
        values.append(legendre.legvander(x, highest[axis]))
        derivatives = legendre.legder(coefficients, axis=0)
        slopes.append(legendre.legval(x, derivatives).T / half[axis])
    index = np.array(powers).T

    def products(derived: int | None) -> Array:
        tables = [(slopes if axis == derived else values)[axis] for axis in range(3)]
        x, y, z = (table[:, index[axis]] for axis, table in enumerate(tables))
        return np.asarray(x * y * z)

    _, singular, right = la.svd(
        np.sqrt(domain.weights)[:, None] * products(None), full_matrices=False
    )
    kept = singular > INDEPENDENT * singular[0]
    change = right[kept].T / singular[kept]
    return np.stack([products(axis) @ change for axis in range(3)])
