"""The 8-node hexahedron with one Young's modulus per quadrature point.

Local numbering: corner and quadrature point `c` sit at the bits `(c & 1, c >> 1 & 1, c >> 2 & 1)`
along (x, y, z); degree of freedom `3 c + i` is the displacement of corner `c` along axis `i`.
"""

from functools import cache, lru_cache

import numpy as np

from carillon.arrays import Array, Index, frozen
from carillon.fem.elasticity import DEFAULT_POISSON, SHEARS, Elasticity, elasticity_matrix

CORNERS: Index = np.array([[c & 1, c >> 1 & 1, c >> 2 & 1] for c in range(8)])
"""(8, 3) offsets of the corners, in bit order."""

KEPT = 8
"""Elasticities whose matrices are kept; searches may go through thousands."""

GAUSS_POINTS: Array = 0.5 + (CORNERS - 0.5) / np.sqrt(3.0)
"""(8, 3) points of the 2x2x2 Gauss rule on the unit cube; each has weight 1/8."""


def shape_functions(points: Array) -> Array:
    """Trilinear shape functions at `points` (p, 3) of the unit cube; shape (p, 8)."""
    return np.asarray(_factors(points).prod(axis=2))


def shape_gradients(points: Array) -> Array:
    """Gradients of the shape functions on the unit cube; shape (p, 8, 3)."""
    factors, signs = _factors(points), 2.0 * CORNERS - 1.0
    gradients = np.empty((len(points), 8, 3))
    for axis in range(3):
        others = [a for a in range(3) if a != axis]
        gradients[:, :, axis] = signs[:, axis] * factors[:, :, others].prod(axis=2)
    return gradients


def _factors(points: Array) -> Array:
    return np.where(CORNERS[None] == 1, points[:, None], 1.0 - points[:, None])


def matrix_of(law: float | Elasticity) -> Array:
    """Elasticity matrix (6, 6) for modulus 1 of a Poisson's ratio, or of any other elasticity."""
    return law.matrix if isinstance(law, Elasticity) else elasticity_matrix(law)


def strain_displacement(gradients: Array) -> Array:
    """Strain-displacement matrices (p, 6, 3 k) from gradients (p, k, 3) of the k nodes' shapes."""
    matrices = np.zeros((len(gradients), 6, gradients.shape[1], 3))
    for axis in range(3):
        matrices[:, axis, :, axis] = gradients[:, :, axis]
    for row, (a, b) in enumerate(SHEARS, start=3):
        matrices[:, row, :, a] = gradients[:, :, b]
        matrices[:, row, :, b] = gradients[:, :, a]
    return matrices.reshape(len(gradients), 6, -1)


@lru_cache(KEPT)
def quadrature_stiffness(law: float | Elasticity = DEFAULT_POISSON) -> Array:
    """Stiffness contributions K_q (8, 24, 24) of the quadrature points for unit edge and modulus.

    An element of edge h with moduli E_q has the stiffness `h * sum_q E_q K_q`. `law` is Poisson's
    ratio, or another elasticity.

    Examples
    --------
    >>> stiffness = quadrature_stiffness(0.25)
    >>> stiffness.shape
    (8, 24, 24)
    >>> rigid = rigid_motions(CORNERS.astype(float))
    >>> bool(abs(stiffness @ rigid).max() < 1e-12)
    True
    """
    strain = strain_displacement(shape_gradients(GAUSS_POINTS))
    elasticity = matrix_of(law)
    matrices = np.einsum("qia,ij,qjb->qab", strain, elasticity, strain, optimize=True) / 8.0
    return frozen(0.5 * (matrices + matrices.transpose(0, 2, 1)))


@lru_cache(KEPT)
def uniform_stiffness(law: float | Elasticity = DEFAULT_POISSON) -> Array:
    """Stiffness (24, 24) of the element with uniform unit modulus and unit edge."""
    return frozen(quadrature_stiffness(law).sum(axis=0))


@cache
def elasticity_stiffness() -> Array:
    """Stiffness (8 * 36, 24 * 24) by the points' elasticity matrices, for unit edge.

    An element of edge h with matrices C_q [Pa] has the stiffness `h * C.ravel() @` this.
    """
    strain = strain_displacement(shape_gradients(GAUSS_POINTS))
    products = np.einsum("qia,qjb->qijab", strain, strain) / 8.0
    return frozen(products.reshape(8 * 36, 24 * 24))


@cache
def nodal_mass(lumped: bool = False) -> Array:
    """Mass (8, 8) between corners for unit edge and density; row sums on the diagonal if `lumped`.

    Each displacement component has this same matrix; an edge h and density rho scale it by rho h^3.

    Examples
    --------
    >>> nodal_mass(lumped=True).diagonal().tolist()
    [0.125, 0.125, 0.125, 0.125, 0.125, 0.125, 0.125, 0.125]
    >>> float(nodal_mass().sum().round(12))
    1.0
    """
    line = np.array([[2.0, 1.0], [1.0, 2.0]]) / 6.0
    matrix = np.kron(np.kron(line, line), line)
    return frozen(np.diag(matrix.sum(axis=1)) if lumped else matrix)


def rigid_motions(nodes: Array, centre: Array | None = None) -> Array:
    """Three translations, three rotations about `centre`, or the centroid of `nodes` (n, 3).

    Displacements of the nodes, (3 n, 6).
    """
    centred = nodes - (nodes.mean(axis=0) if centre is None else centre)
    motions = np.zeros((len(nodes), 3, 6))
    motions[:, np.arange(3), np.arange(3)] = 1.0
    for axis in range(3):
        a, b = (axis + 1) % 3, (axis + 2) % 3
        motions[:, a, 3 + axis] = -centred[:, b]
        motions[:, b, 3 + axis] = centred[:, a]
    return motions.reshape(-1, 6)
