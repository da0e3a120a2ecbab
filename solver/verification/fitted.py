"""Displacements on the nodes of finite cells, from what they are inside the solid.

Cells reach beyond the solid, where other models of it know nothing: their nodes' values there are
those with which displacements inside are nearest to what is known.
"""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from carillon.arrays import Array
from carillon.fem.finite_cells.cells import middles_of_portions
from carillon.fem.finite_cells.model import FiniteCellModel
from carillon.fem.model import Solid
from solver.response.points import interpolation

POINTS_ALONG = 8
"""Points along an edge of a cell, in the voxels that it has something of; of a cell no larger than
one, two fewer. The polynomials of a cell have five coefficients along it."""
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
    """Points (p, 3) [m] in what cells have of voxels, with volumes (p,) [m^3], of its moments.

    Of what is all inside they are Gauss points.
    """
    cells = model.cells
    middles, covariances = middles_of_portions(cells)
    values, axes = np.linalg.eigh(covariances)
    # Halves of the edges of a box with these moments.
    halves = axes * np.sqrt(3.0 * np.maximum(values, 0.0))[:, None]
    volumes = cells.shares * cells.edges[cells.cell] ** 3
    counts = cells.counts[cells.cell]
    points, shares = [], []
    for count in np.unique(counts):
        own = np.flatnonzero(counts == count)
        places, weights = _gauss(min(POINTS_ALONG // int(count), POINTS_ALONG - 2))
        points.append(middles[own, None] + np.einsum("mij,pj->mpi", halves[own], places))
        shares.append(volumes[own, None] * weights)
    return (
        np.concatenate([each.reshape(-1, 3) for each in points]),
        np.concatenate([each.ravel() for each in shares]),
    )


def _gauss(count: int) -> tuple[Array, Array]:
    """Gauss points (count^3, 3) from -1 to 1 and their shares (count^3,)."""
    nodes, weights = np.polynomial.legendre.leggauss(count)
    grid = np.stack(np.meshgrid(nodes, nodes, nodes, indexing="ij"), axis=-1).reshape(-1, 3)
    shares = np.einsum("i,j,k->ijk", weights, weights, weights).ravel() / 8.0
    return grid, shares
