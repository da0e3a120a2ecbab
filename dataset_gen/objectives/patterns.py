"""What a void pattern alone decides about a block, computed once for each of the 255 patterns."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from carillon.arrays import Array, Index
from carillon.fem.block import (
    COARSE_EDGE,
    NODES,
    active_nodes,
    cell_mass,
    cell_stiffness,
    degrees_of_freedom,
    prolongation,
)
from carillon.fem.element import (
    CORNERS,
    GAUSS_POINTS,
    elasticity_matrix,
    rigid_motions,
    shape_gradients,
    strain_displacement,
)
from carillon.processes.threads import blas_threads

NULL_TOLERANCE = 1e-10
"""Eigenvalues below this share of the largest count as motions without strain."""


@dataclass(frozen=True)
class VoidPattern:
    """Matrices of the block's active nodes (those that touch a filled cell) for unit moduli."""

    cells: Index
    """(f,) indices of the filled cells."""
    dofs: Index
    """(a,) degrees of freedom of the active nodes among the block's 81."""
    stiffness: Array
    """(f, a * a) flattened K_j of the filled cells, fine edge 1."""
    mass: Array
    """(a, a) consistent mass of the filled cells, unit density."""
    interpolation: Array
    """(a, 24) rows of the trilinear prolongation, P_a."""
    to_corners: Array
    """(24, a) its pseudo-inverse: the trilinear motion nearest to nodal displacements."""
    rigid: Array
    """(a, 6) orthonormal rigid motions."""
    null: Array
    """(a, k) orthonormal motions without strain; k > 6 where cells hinge on edges or corners."""

    def positions(self, dofs: Index) -> Index:
        """Where degrees of freedom of the block are among the active ones."""
        return np.searchsorted(self.dofs, dofs)

    def assemble(self, young: Array) -> Array:
        """Regularised K(e) + s N N^T of each block, positive definite; `young` (n, 8) -> (n, a, a).

        On loads without a component in N its inverse acts as the pseudo-inverse of K(e).
        """
        size = len(self.dofs)
        filled = young[:, self.cells]
        matrices = (filled[:, None, :] @ self.stiffness).reshape(-1, size, size)
        shift = filled.mean(axis=1)[:, None, None]
        return np.asarray(matrices + shift * (self.null @ self.null.T))

    def without_null(self, loads: Array) -> Array:
        """Component of `loads` (a, m) that does no work on strain-free motions."""
        return np.asarray(loads - self.null @ (self.null.T @ loads))


@cache
@blas_threads(1)
def pattern_of(mask: int, poisson: float) -> VoidPattern:
    """Matrices of the pattern whose filled cells are the set bits of `mask` (1..255)."""
    filled = (mask >> np.arange(8) & 1).astype(bool)
    cells = np.flatnonzero(filled)
    nodes = active_nodes(filled)
    dofs = degrees_of_freedom(nodes)
    square = np.ix_(dofs, dofs)
    stiffness = np.stack([cell_stiffness(poisson)[cell][square] for cell in cells])
    nodal = cell_mass()[cells].sum(axis=0)[np.ix_(nodes, nodes)]
    interpolation = prolongation()[dofs]
    values, vectors = np.linalg.eigh(stiffness.sum(axis=0))
    return VoidPattern(
        cells=cells,
        dofs=dofs,
        stiffness=np.ascontiguousarray(stiffness.reshape(len(cells), -1)),
        mass=np.kron(nodal, np.eye(3)),
        interpolation=interpolation,
        to_corners=np.linalg.pinv(interpolation),
        rigid=np.linalg.qr(rigid_motions(NODES[nodes].astype(float)))[0],
        null=vectors[:, values < NULL_TOLERANCE * values[-1]],
    )


@cache
@blas_threads(1)
def corner_strains(poisson: float) -> Array:
    """S (48, 24) with `K_q = S_q^T S_q` of the coarse element of edge 2, S_q = S[6 q : 6 q + 6]."""
    strain = strain_displacement(shape_gradients(GAUSS_POINTS))
    root = np.linalg.cholesky(elasticity_matrix(poisson)).T
    return np.asarray(np.sqrt(COARSE_EDGE / 8.0) * (root @ strain)).reshape(48, 24)


@cache
@blas_threads(1)
def straining_motions() -> Array:
    """Orthonormal complement Z (24, 18) of the rigid motions of the coarse corners."""
    rigid = rigid_motions(CORNERS.astype(float))
    return np.asarray(np.linalg.qr(rigid, mode="complete")[0][:, 6:])
