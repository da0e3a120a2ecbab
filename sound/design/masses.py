"""Derivatives of eigenpairs by the densities of regions, which the mass is linear in.

With M-orthonormal modes, d lambda_k = u_k^T (dK - lambda_k dM) u_k, and f^T u_k changes by
x_k^T (dK - lambda_k dM) u_k - (u_k^T dM u_k) (f^T u_k) / 2, see `sound.design.sensitivity` for x_k.
Motions without strain are among the other modes then: they have mass. For modes close to k, whose
mixture is not determined one by one, the symmetric product
u_i^T (dK - (lambda_i + lambda_j) / 2 dM) u_j stands for that of the stiffness, and half of
u_i^T dM u_j goes to each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from carillon.arrays import Array, Index
from carillon.fem.model import Solid


@dataclass(frozen=True)
class SolidModes:
    """Mass-orthonormal modes on the nodes of the mesh, and what is pushed."""

    values: Array
    """(N,) eigenvalues [rad^2/s^2] of the elastic ones."""
    elastic: Array
    rigid: Array
    """(3 n, N) and (3 n, r)."""
    pushes: Array
    """(3 n, T) forces f."""


def nodal_mass(model: Solid, rows: Sequence[int]) -> sp.csr_matrix:
    """Mass (n, n) [m^3] between the nodes for density 1 of some regions that have one density."""
    chosen = list(rows)
    free = model.with_supports(None)
    doubled = free.regions.density.copy()
    doubled[chosen] *= 2.0
    heavier = free.with_regions(replace(free.regions, density=doubled))
    # The mass is linear in the densities.
    mass = (heavier.nodal_mass() - free.nodal_mass()) / free.regions.density[chosen[0]]
    nodes = model.connectivity
    width = nodes.shape[1]
    places = np.repeat(nodes, width, axis=1).ravel(), np.tile(nodes, width).ravel()
    matrix = sp.csr_matrix((mass.ravel(), places), shape=(model.n_nodes,) * 2)
    matrix.eliminate_zeros()
    return matrix


def by_density(
    mass: sp.csr_matrix, modes: SolidModes, pairs: Index, others: Array
) -> tuple[Array, Array]:
    """Derivatives by a density: (P,) of pairs of modes in the place of the stiffness, and (T, N) of
    the pushed modes outside of those close to each.

    `mass` (n, n) is its nodal mass, `pairs` are those of `Sensitivity`, `others` (3 n, T, N) are x.
    """
    values, count = modes.values, len(modes.values)
    moved = _times(mass, modes.elastic)
    gram = modes.elastic.T @ moved
    i, j = pairs.T
    close = np.zeros((count, count))
    close[i, j] = close[j, i] = gram[i, j]
    stiffness = -0.5 * (values[i] + values[j]) * gram[i, j]
    pushed = modes.pushes.T @ modes.elastic
    beyond = -values * np.einsum("dtn,dn->tn", others, moved)
    # x_k of a motion without strain is over lambda_k.
    beyond -= (modes.pushes.T @ modes.rigid) @ (modes.rigid.T @ moved)
    return stiffness, beyond - 0.5 * pushed @ close


def _times(mass: sp.csr_matrix, vectors: Array) -> Array:
    """Products (3 n, k) of the mass of each component."""
    return np.asarray(mass @ vectors.reshape(mass.shape[0], -1)).reshape(vectors.shape)
