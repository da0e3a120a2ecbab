"""Displacements on the nodes of finite cells, from what they are inside the solid.

Cells reach beyond the solid, where other models of it know nothing: their nodes' values there are
those with which displacements inside are nearest to what is known.
"""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from carillon.arrays import Array
from carillon.fem.element import CORNERS
from carillon.fem.finite_cells.cells import middles_of_voxels
from carillon.fem.finite_cells.model import FiniteCellModel
from carillon.fem.model import Solid
from solver.response.points import interpolation

LEAST = 1e-9
"""Weight of a node's own value, over that of all that is near it, by which those of which nothing
is inside stay small."""


def fitted(cells: FiniteCellModel, other: Solid, modes: Array) -> Array:
    """Modes (n_dofs, k) of finite cells that are nearest to those of another model of the solid."""
    points, volumes = _points_inside(cells)
    own, seen = interpolation(cells, points), interpolation(other, points)
    weighted = (sp.diags(volumes) @ own).T
    matrix = (weighted @ own).tocsc()
    near = matrix.diagonal()
    matrix += sp.diags(LEAST * np.maximum(near, LEAST * near.max()))
    right = weighted @ (seen @ modes.reshape(other.n_nodes, -1))
    return splu(matrix.tocsc()).solve(right).reshape(-1, modes.shape[1])


def _points_inside(model: FiniteCellModel) -> tuple[Array, Array]:
    """Points (8 m, 3) [m] in the voxels, with volumes (8 m,) [m^3], that have their moments.

    Of a voxel that is all inside they are Gauss points.
    """
    middles, covariances = middles_of_voxels(model.cells)
    values, axes = np.linalg.eigh(covariances)
    reach = np.sqrt(np.maximum(values, 0.0))[:, None] * (2.0 * CORNERS - 1.0)
    points = middles[:, None] + np.einsum("mij,mpj->mpi", axes, reach)
    cells = model.cells
    inside = cells.shares * cells.edges[cells.cell] ** 3
    volumes = np.bincount(cells.voxel, inside, minlength=len(middles)) / len(CORNERS)
    return points.reshape(-1, 3), np.repeat(volumes, len(CORNERS))
