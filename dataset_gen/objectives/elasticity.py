"""Elasticity matrices of the cells of a block: their numbers, size, mean and images.

Matrices (6, 6) are in the order xx, yy, zz, xy, yz, zx with engineering shear strains, that of
`carillon.fem.element.strain_displacement`.
"""

from functools import cache
from itertools import permutations, product

import numpy as np

from carillon.arrays import Array, Flags, Index
from carillon.fem.element import GAUSS_POINTS, shape_gradients, strain_displacement

STRAIN_AXES = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
"""Axes of each strain."""
ROW, COLUMN = np.tril_indices(6)
"""Where the 21 numbers of a symmetric matrix stand, row by row of its lower triangle."""
NUMBERS = len(ROW)
"""Numbers of an elasticity matrix."""
STIFFNESS_WEIGHTS = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0]) / 6.0
"""What the diagonal adds to the `stiffness_size`: no direction counts more than another."""


def stiffness_size(elasticity: Array) -> Array:
    """Trace of matrices (..., 6, 6) for orthonormal strains, divided by 6 [Pa].

    It does not change when a matrix is rotated, and it is linear: that of a mean is the mean.
    """
    return np.asarray((np.einsum("...ii->...i", elasticity) * STIFFNESS_WEIGHTS).sum(axis=-1))


def filled_mean(values: Array, filled: Flags) -> Array:
    """Mean (n, ...) over the filled cells of `values` (n, 8, ...); `filled` is (n, 8)."""
    shares = (filled / filled.sum(axis=1, keepdims=True)).reshape(
        filled.shape + (1,) * (values.ndim - 2)
    )
    return np.asarray((values * shares).sum(axis=1))


@cache
def unit_cells() -> Array:
    """Stiffness (21, 24, 24) of a cell of edge 1 from each number of its elasticity matrix."""
    strain = strain_displacement(shape_gradients(GAUSS_POINTS))
    products = np.einsum("qia,qjb->ijab", strain, strain) / len(strain)
    both = products[ROW, COLUMN] + products[COLUMN, ROW]
    both[ROW == COLUMN] *= 0.5
    return np.asarray(both)


@cache
def _images() -> tuple[Index, Array]:
    """Strain (48, 6) that each strain of a turned block comes from, and with which sign (48, 6).

    The symmetries are in the order of `carillon.fem.block.symmetries`.
    """
    number = {frozenset(pair): i for i, pair in enumerate(STRAIN_AXES)}
    sources, signs = [], []
    for axes, flips in product(permutations(range(3)), product((0, 1), repeat=3)):
        sources.append([number[frozenset((axes[a], axes[b]))] for a, b in STRAIN_AXES])
        signs.append([(-1.0) ** (flips[a] + flips[b]) for a, b in STRAIN_AXES])
    return np.array(sources), np.array(signs)


def turned(elasticity: Array, symmetry: Index) -> Array:
    """Matrices (n, ..., 6, 6) of solids after a symmetry (n,) of the cube each.

    Numbers change places and signs, no more.
    """
    sources, signs = _images()
    shape = (len(symmetry),) + (1,) * (elasticity.ndim - 3) + (6,)
    source, sign = sources[symmetry].reshape(shape), signs[symmetry].reshape(shape)
    rows = np.take_along_axis(elasticity, source[..., :, None], axis=-2)
    both = np.take_along_axis(rows, source[..., None, :], axis=-1)
    return np.asarray(both * (sign[..., :, None] * sign[..., None, :]))
