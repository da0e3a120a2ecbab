"""Shape functions of the quadratic 27-node cell, and what its matrices are summed from.

Node k sits at ``carillon.fem.block.NODES[k]`` on the lattice of half edges; degree of freedom
``3 k + i`` is the displacement of node k along axis i. Products of two shape functions, or of two
of their gradients, are polynomials of degree four at most in each coordinate. They are integrated
over any part of the cell by their values at 5x5x5 Gauss points; the weights are the integrals of
the points' Lagrange polynomials over that part, which are its moments in another basis.
"""

from functools import cache, lru_cache

import numpy as np

from carillon.arrays import Array, frozen
from carillon.fem.block import NODES
from carillon.fem.elasticity import Elasticity
from carillon.fem.element import CORNERS, KEPT, matrix_of, strain_displacement

POINTS = 125
"""Points that the integrals over a cell are taken from; i + 5 j + 25 k is at i, j, k along x, y,
z."""
OCTANTS = 8
"""Voxels that a cell is made of, in bit order."""
NODE_PLACES: Array = np.array([0.0, 0.5, 1.0])
"""(3,) places of the nodes on an edge of length one."""
POINT_PLACES: Array = 0.5 + 0.5 * np.polynomial.legendre.leggauss(5)[0]
"""(5,) places of the points on it."""


def lagrange(nodes: Array, at: Array) -> Array:
    """Lagrange polynomials (p, n) of the `nodes` (n,) at places (p,)."""
    values = np.ones((len(at), len(nodes)))
    for i, node in enumerate(nodes):
        for other in np.delete(nodes, i):
            values[:, i] *= (at - other) / (node - other)
    return values


def lagrange_slopes(nodes: Array, at: Array) -> Array:
    """Their derivatives (p, n)."""
    slopes = np.zeros((len(at), len(nodes)))
    for i, node in enumerate(nodes):
        others = np.delete(nodes, i)
        for left in range(len(others)):
            term = np.full(len(at), 1.0 / (node - others[left]))
            for other in np.delete(others, left):
                term *= (at - other) / (node - other)
            slopes[:, i] += term
    return slopes


def shape_functions(points: Array) -> Array:
    """Shape functions (p, 27) at `points` (p, 3) of the unit cube."""
    return _products([lagrange(NODE_PLACES, points[:, axis]) for axis in range(3)])


def shape_gradients(points: Array) -> Array:
    """Their gradients (p, 27, 3)."""
    gradients = np.empty((len(points), len(NODES), 3))
    for along in range(3):
        factors = [
            (lagrange_slopes if axis == along else lagrange)(NODE_PLACES, points[:, axis])
            for axis in range(3)
        ]
        gradients[:, :, along] = _products(factors)
    return gradients


def _products(factors: list[Array]) -> Array:
    """Products (p, nx ny nz), x fastest, of values (p, n) along each axis."""
    x, y, z = factors
    return np.asarray(np.einsum("pk,pj,pi->pkji", z, y, x).reshape(len(x), -1))


@cache
def points() -> Array:
    """Places (125, 3) of the points in the unit cube."""
    z, y, x = np.meshgrid(POINT_PLACES, POINT_PLACES, POINT_PLACES, indexing="ij")
    return np.stack([x, y, z], axis=-1).reshape(-1, 3)


def polynomials(places: Array) -> Array:
    """Lagrange polynomials (p, 125) of the points at `places` (p, 3) in, or beside, the cell."""
    return _products([lagrange(POINT_PLACES, places[:, axis]) for axis in range(3)])


@cache
def octant_weights() -> Array:
    """Weights (8, 125) of whole octants of a cell of volume one.

    Examples
    --------
    >>> octant_weights().sum(axis=1).round(12).tolist()
    [0.125, 0.125, 0.125, 0.125, 0.125, 0.125, 0.125, 0.125]
    """
    places, shares = np.polynomial.legendre.leggauss(3)
    halves = [
        shares / 4.0 @ lagrange(POINT_PLACES, (places + 1.0) / 4.0 + half / 2.0)
        for half in range(2)
    ]
    octants = [_products([halves[bit][None] for bit in corner])[0] for corner in CORNERS]
    return frozen(np.array(octants))


@lru_cache(KEPT)
def strain_factors(law: float | Elasticity) -> Array:
    """B (125, 6, 81): strains at the points, times a root of the elasticity, for a unit edge.

    A cell of edge h with weighted moduli w_p [Pa] has the stiffness ``h * sum_p w_p B_p^T B_p``.
    `law` is Poisson's ratio, or another elasticity.
    """
    root = np.linalg.cholesky(matrix_of(law)).T
    return frozen(root @ strain_displacement(shape_gradients(points())))


@lru_cache(KEPT)
def point_stiffness(law: float | Elasticity) -> Array:
    """B_p^T B_p (125, 81 * 81), see `strain_factors`."""
    factors = strain_factors(law)
    return frozen((factors.transpose(0, 2, 1) @ factors).reshape(POINTS, -1))


@cache
def point_mass() -> Array:
    """N_p^T N_p (125, 27 * 27) of the shape functions N at the points."""
    values = shape_functions(points())
    return frozen((values[:, :, None] * values[:, None, :]).reshape(POINTS, -1))
