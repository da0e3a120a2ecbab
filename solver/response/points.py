"""Points of a solid as weights of the unknowns of its model, and the motion of modes there."""

import numpy as np
import scipy.sparse as sp

from carillon.arrays import Array
from carillon.fem.embedding import embedding
from carillon.fem.finite_cells.model import FiniteCellModel
from carillon.fem.model import Solid


def motion_at(model: Solid, modes: Array, points: Array) -> Array:
    """Displacement (p, 3, k) of `points` (p, 3) [m] in modes (n_dofs, k)."""
    values = interpolation(model, points)
    motion = values @ modes.reshape(model.n_nodes, -1)
    return np.asarray(motion).reshape(values.shape[0], 3, -1)


def voxel_motion(model: Solid, modes: Array) -> Array:
    """Motion (3 n, ...) of the corners of voxels, `model.mesh`, in modes (n_dofs, ...)."""
    if not isinstance(model, FiniteCellModel):
        return modes
    values = interpolation(model, model.mesh.nodes)
    moved = values @ modes.reshape(model.n_nodes, -1)
    return np.asarray(moved).reshape(-1, *modes.shape[1:])


def forces_at(model: Solid, points: Array, directions: Array) -> Array:
    """Forces (n_dofs, p) on the unknowns by forces `directions` (p, 3) at `points` (p, 3) [m]."""
    weights = interpolation(model, points).toarray()
    return np.asarray((weights[:, :, None] * directions[:, None, :]).reshape(len(points), -1).T)


def interpolation(model: Solid, points: Array) -> sp.csr_matrix:
    """Interpolation from the nodes to `points` (p, 3) [m], as a matrix (p, n).

    A point outside all elements takes the value of the nearest point of a nearest one.

    Examples
    --------
    >>> from carillon.fem.geometry import hexmesh_from_grid
    >>> from carillon.fem.model import fine_model
    >>> mesh = hexmesh_from_grid(np.array([[0, 0, 0], [1, 0, 0]]), np.zeros(3), 0.5)
    >>> model = fine_model(mesh, np.ones(2))
    >>> interpolation(model, np.array([[0.25, 0.0, 0.0], [1.0, 0.5, 0.0]])).toarray()[:, :6]
    array([[0.5, 0.5, 0. , 0. , 0. , 0. ],
           [0. , 0. , 0. , 0. , 0. , 1. ]])
    """
    elements, weights = embedding(model, points)
    rows = np.repeat(np.arange(len(elements)), weights.shape[1])
    shape = (len(elements), model.n_nodes)
    nodes = model.connectivity[elements]
    matrix = sp.csr_matrix((weights.ravel(), (rows, nodes.ravel())), shape=shape)
    matrix.eliminate_zeros()
    return matrix
