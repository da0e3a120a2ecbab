"""The 2x2x2 block of fine hexahedra that one coarse hexahedron replaces.

Numbering: fine cell `j` of the block and coarse corner `c` use the bit order of
`carillon.fem.element`; the 27 nodes are numbered x fastest, then y, then z, on {0,1,2}^3. All
matrices are for fine edge 1 and unit modulus or density.
"""

from functools import cache
from itertools import permutations, product

import numpy as np

from carillon.arrays import Array, Flags, Index, frozen
from carillon.fem.element import (
    CORNERS,
    DEFAULT_POISSON,
    nodal_mass,
    shape_functions,
    uniform_stiffness,
)

COARSE_EDGE = 2.0
"""Edge of the coarse cell; that of a fine cell is 1."""

ALL_FILLED = 0b11111111
"""Void pattern without void cells; bit j of a pattern is set where cell j is filled."""

NODES: Index = np.array([[x, y, z] for z in range(3) for y in range(3) for x in range(3)])
"""(27, 3) lattice positions of the block's nodes."""

CELL_NODES: Index = np.array(
    [[(o + c) @ (1, 3, 9) for c in CORNERS] for o in CORNERS], dtype=np.int64
)
"""(8, 8) nodes of each fine cell."""

CORNER_NODES: Index = np.array([2 * c @ (1, 3, 9) for c in CORNERS], dtype=np.int64)
"""(8,) block nodes that are the coarse element's corners."""


def degrees_of_freedom(nodes: Index) -> Index:
    """Degrees of freedom 3n, 3n+1, 3n+2 of nodes (..., n), in order; shape (..., 3 n)."""
    dofs = 3 * nodes[..., None] + np.arange(3)
    return dofs.reshape(*nodes.shape[:-1], -1)


@cache
def nodal_prolongation() -> Array:
    """Trilinear interpolation (27, 8) from the coarse corners to the block's nodes."""
    return frozen(shape_functions(NODES / COARSE_EDGE))


@cache
def prolongation() -> Array:
    """P (81, 24): `nodal_prolongation` for each displacement component."""
    return frozen(np.kron(nodal_prolongation(), np.eye(3)))


@cache
def cell_stiffness(poisson: float = DEFAULT_POISSON) -> Array:
    """K_j (8, 81, 81) of each fine cell, so that the block has `K(e) = sum_j e_j K_j`."""
    matrices = np.zeros((8, 81, 81))
    for cell, nodes in enumerate(CELL_NODES):
        dofs = degrees_of_freedom(nodes)
        matrices[cell][np.ix_(dofs, dofs)] = uniform_stiffness(poisson)
    return frozen(matrices)


@cache
def cell_mass() -> Array:
    """Nodal mass (8, 27, 27) of each fine cell for unit density."""
    matrices = np.zeros((8, 27, 27))
    for cell, nodes in enumerate(CELL_NODES):
        matrices[cell][np.ix_(nodes, nodes)] = nodal_mass()
    return frozen(matrices)


@cache
def coarse_cell_mass() -> Array:
    """Share (8, 8, 8) of each fine cell in the coarse nodal mass: P^T M_j P for unit density."""
    interpolation = nodal_prolongation()
    operands = interpolation, cell_mass(), interpolation
    return frozen(np.einsum("na,jnm,mb->jab", *operands, optimize=True))


def galerkin_moduli(young: Array) -> Array:
    """Moduli (n, 8) with `h sum_q E_q K_q = P^T K(e) P` for blocks (n, 8), exactly.

    Along each axis a quadrature point takes 1/2 + sqrt(3)/4 from its own half and the rest from the
    other one: the weights that integrate 1 and x over either half of the element.

    Examples
    --------
    >>> galerkin_moduli(np.ones((1, 8))).round(12).tolist()
    [[1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0]]
    """
    near = 0.5 + np.sqrt(3.0) / 4.0
    line = np.array([[near, 1.0 - near], [1.0 - near, near]])
    weights = np.kron(np.kron(line, line), line)
    # Not a matrix product: BLAS rounds a lone row differently.
    return np.asarray((young[:, :, None] * weights).sum(axis=1))


def active_nodes(filled: Flags) -> Index:
    """Sorted nodes of the block that touch a filled cell; `filled` is (8,)."""
    return np.unique(CELL_NODES[filled])


def void_patterns(young: Array) -> Index:
    """Void patterns (n,) of blocks (n, 8), or that of one block (8,): bit j if cell j is filled.

    Examples
    --------
    >>> void_patterns(np.array([[1.0, 2, 0, 0, 0, 0, 0, 3], [0, 1, 0, 0, 0, 0, 0, 0]])).tolist()
    [131, 2]
    """
    return np.asarray((young > 0.0) @ (1 << np.arange(8)))


@cache
def symmetries() -> Index:
    """The cube's 48 symmetries as permutations (48, 8): row g sends cell j to [g, j]."""
    images = [
        (CORNERS[:, list(axes)] ^ np.array(flips)) @ (1, 2, 4)
        for axes, flips in product(permutations(range(3)), product((0, 1), repeat=3))
    ]
    return frozen(np.array(images, dtype=np.int64))


@cache
def pattern_images() -> Index:
    """Images (256, 48) of every void pattern under the cube's symmetries."""
    filled = np.arange(256)[:, None] >> np.arange(8) & 1
    return frozen(filled @ (1 << symmetries()).T)


def least_patterns() -> list[int]:
    """Least void pattern of each of the 21 classes under the cube's symmetries, all void aside."""
    least = pattern_images().min(axis=1)
    return [mask for mask in range(1, 256) if least[mask] == mask]
