"""Cubes that show a solid: its elements or the octants of its finite cells, and motion of them.

Corners that hang between larger elements are points of their own, so that every cube has eight, at
its own corners, and is seen where the model has it.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from carillon.arrays import Array, Index
from carillon.fem.block import CELL_NODES, CORNER_NODES
from carillon.fem.finite_cells import hanging as finite_cell_nodes
from carillon.fem.finite_cells.model import FiniteCellModel
from carillon.fem.geometry import HexMesh
from carillon.fem.geometry.hanging import node_weights
from carillon.fem.model import ElasticModel, Solid


@dataclass(frozen=True, eq=False)
class Displayed:
    """Cubes of a solid, with their material."""

    cells: Index
    """(c, 8) points of each cube, in bit order."""
    interpolation: sp.csr_matrix | None
    """(p, n) values of the points from those of the nodes; None if points are the nodes."""
    points: Array
    """(p, 3) [m]."""
    young: Array
    """(c,) mean Young's modulus [Pa]."""
    density: Array
    """(c,) mass over volume of each cube [kg/m^3], with what of it is void."""

    def vectors(self, displacement: Array) -> Array:
        """Displacement (p, 3) of the points from that (n, 3) of the nodes."""
        if self.interpolation is None:
            return displacement
        return np.asarray(self.interpolation @ displacement)


def displayed(model: Solid) -> Displayed:
    """The cubes of a solid.

    Elements are one cube each, void octants of coarse ones with them. Of finite cells the octants
    that hold material are shown, at whose corners all their nodes are; a divided cell that lies in
    one voxel is one cube.
    """
    if isinstance(model, FiniteCellModel):
        return _finite_cells(model)
    assert isinstance(model, ElasticModel)
    mesh = model.mesh
    share = model.filled.mean(axis=1)
    young = model.young.mean(axis=1)
    if mesh.kinds is None:
        return Displayed(mesh.cells, None, mesh.nodes, young, model.density * share)
    weights = node_weights()[mesh.kinds]
    hangs = (mesh.hanging[:, None] >> np.arange(8) & 1).astype(bool)  # type: ignore[index]
    cells, matrix = _with_hanging(mesh.cells, hangs, mesh.cells, weights, mesh)
    return Displayed(cells, matrix, matrix @ mesh.nodes, young, model.density * share)


def _finite_cells(model: FiniteCellModel) -> Displayed:
    cells, mesh = model.cells, model.mesh
    owner, octant = np.nonzero(cells.voxels >= 0)
    voxel, first = np.unique(cells.voxels[owner, octant], return_index=True)
    octants = np.bincount(cells.voxels[owner, octant], cells.fractions[owner, octant])
    if cells.kinds is None:
        return Displayed(mesh.cells, None, mesh.nodes, model.young, model.density * octants)
    owner, octant = owner[first], octant[first]
    whole = cells.span[owner] == 4
    density = model.density * octants / np.where(whole, 1.0, 8.0)
    slots = np.where(whole[:, None], CELL_NODES[octant], CORNER_NODES)
    kinds = cells.kinds[owner]
    hangs = (kinds[:, None] & finite_cell_nodes.BITS) > 0
    hangs = np.take_along_axis(hangs, slots, axis=1)
    corners = np.take_along_axis(cells.nodes[owner], slots, axis=1)
    some = np.flatnonzero(hangs.any(axis=1))
    weights = np.zeros((len(voxel), 8, 27))
    weights[some] = np.take_along_axis(
        finite_cell_nodes.node_weights(kinds[some]), slots[some][:, :, None], axis=1
    )
    cubes, matrix = _with_hanging(corners, hangs, cells.nodes[owner], weights, mesh)
    return Displayed(cubes, matrix, matrix @ mesh.nodes, model.young, density)


def _with_hanging(
    corners: NDArray[np.integer],
    hangs: NDArray[np.bool_],
    nodes: NDArray[np.integer],
    weights: Array,
    mesh: HexMesh,
) -> tuple[Index, sp.csr_matrix]:
    """Points (c, 8) of cubes, and the matrix from nodes to points; those that hang come last.

    `corners` (c, 8) are nodes, where they do not hang (c, 8); there the values are `weights`
    (c, 8, k) of the elements' `nodes` (c, k).
    """
    cell, corner = np.nonzero(hangs)
    rows = np.repeat(np.arange(len(cell)), nodes.shape[1])
    data = (weights[cell, corner].ravel(), (rows, nodes[cell].ravel()))
    each = sp.csr_matrix(data, shape=(len(cell), mesh.n_nodes))
    each.eliminate_zeros()
    each.sort_indices()
    # Points that say the same of the same nodes are one.
    first, number = _distinct_rows(each)
    cells = corners.astype(np.int64)
    cells[cell, corner] = mesh.n_nodes + number
    return cells, sp.vstack([sp.identity(mesh.n_nodes), each[first]], format="csr")


def _distinct_rows(matrix: sp.csr_matrix) -> tuple[Index, Index]:
    """First of equal rows, and which of these each row is (rows,)."""
    longest = int(np.diff(matrix.indptr).max(initial=0))
    place = np.arange(matrix.nnz) - np.repeat(matrix.indptr[:-1], np.diff(matrix.indptr))
    row = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    table = np.full((matrix.shape[0], 2 * longest), -1.0)
    table[row, place] = matrix.indices
    table[row, longest + place] = np.round(matrix.data, 12)
    _, first, number = np.unique(table, axis=0, return_index=True, return_inverse=True)
    return first, number.ravel()
