"""Lowest modes of one subdomain."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver.hcms.condense import restrict_mass, restrict_stiffness
from solver.lowest import lowest_modes
from solver.model import ElasticModel
from solver.sparse import assemble_elements

Array = NDArray[np.float64]


def local_modes(
    model: ElasticModel, nodes: NDArray[np.int64], keep: int, interface: str
) -> tuple[Array, Array]:
    """Lowest eigenpairs of the subdomain that consists of `nodes`.

    Elements that straddle its boundary are restricted to the nodes inside, see
    `solver.hcms.condense`.

    Returns
    -------
    values (k,) [rad^2/s^2] and mass-orthonormal vectors (3 * len(nodes), k), rows in the order of
    `nodes`, with k = min(keep, 3 * len(nodes)).
    """
    position = np.full(model.mesh.n_nodes, -1, dtype=np.int64)
    position[nodes] = np.arange(len(nodes))
    local = position[model.mesh.cells]
    touching = np.flatnonzero((local >= 0).any(axis=1))
    local = local[touching]
    inside = local >= 0
    stiffness = restrict_stiffness(model.stiffness(touching), inside, interface)
    mass = restrict_mass(model.nodal_mass(touching), inside)
    # Rows and columns of outside corners are zero, so any inside node may stand for them.
    K, M = assemble_elements(np.where(inside, local, 0), stiffness, mass, len(nodes))
    return lowest_modes(K, M, min(keep, K.shape[0]))
