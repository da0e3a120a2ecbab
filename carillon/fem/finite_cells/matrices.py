"""Element matrices of finite cells from the weights of their points.

Integrals of the products of two gradients, 50 by 50 for each pair of axes, are one product of the
weights with a table; elasticity combines them. A table has fewer numbers than the 9^3 points of a
tensor rule would need, so that this takes about as many operations as sum factorisation, all of
them in one product of large matrices.
"""

from __future__ import annotations

from functools import cache, lru_cache

import numba
import numpy as np

from carillon.arrays import Array, frozen
from carillon.fem.elasticity import SHEARS, Elasticity
from carillon.fem.element import KEPT, matrix_of, strain_displacement
from carillon.fem.finite_cells.basis import basis

AT_ONCE = 64
"""Cells whose products are held at once: 8 MB."""
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Axes of the gradients whose products are in a table."""


def stiffness(degree: int, elasticity: Array, weights: Array) -> Array:
    """Stiffness (c, 3 n, 3 n) of cells of edge one with weights (c, d), or moduli by them [Pa].

    `elasticity` (6, 6) is that of modulus 1.
    """
    nodes = basis(degree).n_nodes
    matrices = np.empty((len(weights), 3 * nodes, 3 * nodes))
    for first in range(0, len(weights), AT_ONCE):
        few = slice(first, first + AT_ONCE)
        products = weights[few] @ gradient_products(degree)
        matrices[few] = combined(products.reshape(-1, len(PAIRS), nodes, nodes), elasticity)
    return matrices


def combined(products: Array, elasticity: Array) -> Array:
    """Stiffness (c, 3 k, 3 k) from products (c, 6, k, k) of gradients along `PAIRS` of axes.

    `elasticity` (6, 6) is that of modulus 1.
    """
    tensor = _tensor(elasticity)
    place = np.argwhere(tensor)
    size = 3 * products.shape[2]
    matrices = np.empty((len(products), size, size))
    _combine(products, place, tensor[tuple(place.T)], matrices)
    return matrices


def nodal_mass(degree: int, weights: Array) -> Array:
    """Mass (c, n, n) of cells of edge one with weights (c, d), or densities by them [kg/m^3]."""
    nodes = basis(degree).n_nodes
    return np.asarray(weights @ value_products(degree)).reshape(-1, nodes, nodes)


@cache
def gradient_products(degree: int) -> Array:
    """Products (d, 6 n^2) of the gradients at the points along `PAIRS` of axes."""
    shape = basis(degree)
    slopes = shape.gradients(shape.points)
    table = np.empty((shape.n_points, len(PAIRS), shape.n_nodes, shape.n_nodes))
    for pair, (a, b) in enumerate(PAIRS):
        table[:, pair] = slopes[:, :, None, a] * slopes[:, None, :, b]
    return frozen(table.reshape(shape.n_points, -1))


@cache
def value_products(degree: int) -> Array:
    """Products (d, n^2) of the shape functions at the points."""
    shape = basis(degree)
    values = shape.functions(shape.points)
    return frozen((values[:, :, None] * values[:, None, :]).reshape(shape.n_points, -1))


@lru_cache(KEPT)
def strain_factors(degree: int, law: float | Elasticity) -> Array:
    """B (d, 6, 3 n): strains at the points, times a root of the elasticity, for a unit edge.

    A cell of edge h with weighted moduli w_p [Pa] has the stiffness ``h * sum_p w_p B_p^T B_p``.
    `law` is Poisson's ratio, or another elasticity.
    """
    root, shape = np.linalg.cholesky(matrix_of(law)).T, basis(degree)
    return frozen(root @ strain_displacement(shape.gradients(shape.points)))


def _tensor(elasticity: Array) -> Array:
    """Work (3, 3, 3, 3) of gradients: [a, b, c, d] of d u_a / d x_c on d v_b / d x_d."""
    number = np.empty((3, 3), dtype=np.int64)
    number[np.arange(3), np.arange(3)] = np.arange(3)
    for shear, (a, b) in enumerate(SHEARS, start=3):
        number[a, b] = number[b, a] = shear
    full = elasticity[number[:, :, None, None], number[None, None]]
    return np.asarray(full.transpose(0, 2, 1, 3))


@numba.njit(cache=True, nogil=True)
def _combine(products, place, factor, matrices):  # type: ignore[no-untyped-def]
    own = np.empty((3, 3))
    block = np.empty((3, 3))
    nodes = products.shape[2]
    for cell in range(len(products)):
        for i in range(nodes):
            for j in range(i, nodes):
                for axis in range(3):
                    own[axis, axis] = products[cell, axis, i, j]
                own[0, 1], own[1, 0] = products[cell, 3, i, j], products[cell, 3, j, i]
                own[0, 2], own[2, 0] = products[cell, 4, i, j], products[cell, 4, j, i]
                own[1, 2], own[2, 1] = products[cell, 5, i, j], products[cell, 5, j, i]
                block[:] = 0.0
                for entry in range(len(factor)):
                    a, b = place[entry, 0], place[entry, 1]
                    block[a, b] += factor[entry] * own[place[entry, 2], place[entry, 3]]
                for a in range(3):
                    for b in range(3):
                        matrices[cell, 3 * i + a, 3 * j + b] = block[a, b]
                        matrices[cell, 3 * j + b, 3 * i + a] = block[a, b]
