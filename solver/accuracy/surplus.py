"""What of a mode's strain energy larger cells could not represent.

The displacements of finite cells are quadratic in each. How much of their energy is lost where
eight cells, or 64, are replaced by one of as much edge, with the displacements there that are
nearest in energy, tells how fast the modes converge at that place.
"""

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from carillon.arrays import Array, Index
from carillon.fem.block import degrees_of_freedom
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.model import FiniteCellModel
from carillon.fem.finite_cells.shapes import shape_functions
from carillon.fem.geometry.faces import face_neighbours

CHUNK = 256
"""Approximate number of cells whose matrices are held at once."""
SHIFT = 1e-11
"""Shift that makes the stiffness of a larger cell regular, relative to its trace."""


def energy_lost(
    model: FiniteCellModel, modes: Array, groups: Index, corners: Index, edge: int
) -> Array:
    """Energy (c, k) in each cell of what one larger cell about its group cannot represent.

    Parameters
    ----------
    modes
        (n_dofs, k) displacements.
    groups : (c,)
        Of the cells; -1 for cells that are not asked for.
    corners : (c, 3)
        Lowest corner of the larger cell, in steps of the lattice.
    edge
        Of the larger cell, in steps.
    """
    lost = np.zeros((len(groups), modes.shape[1]))
    order = np.argsort(groups, kind="stable")
    order = order[groups[order] >= 0]
    begins = np.flatnonzero(np.diff(groups[order], prepend=-1))
    while len(begins):
        # Whole groups, of so many cells that one chunk's matrices fit into memory.
        stop = max(int(np.searchsorted(begins, begins[0] + CHUNK)), 1)
        last = int(begins[stop]) if stop < len(begins) else len(order)
        cells = order[begins[0] : last]
        starts = begins[:stop] - begins[0]
        begins = begins[stop:]
        lost[cells] = _lost(model, modes, cells, starts, corners[cells], edge)
    return lost


def _lost(
    model: FiniteCellModel, modes: Array, cells: Index, starts: Index, corners: Index, edge: int
) -> Array:
    nodes = model.connectivity[cells]
    places = (model.mesh.node_grid[nodes] - corners[:, None]) / edge
    shapes = shape_functions(places.reshape(-1, 3)).reshape(len(cells), 27, 27)
    # What holds a cell would weigh displacements that larger cells have where it is held.
    stiffness = model.elements.free_stiffness(cells)
    displacements = modes[degrees_of_freedom(nodes.astype(np.int64))]
    between = _from_nodes(stiffness, shapes)
    large = np.add.reduceat(_to_nodes(between, shapes), starts)
    forces = np.add.reduceat(_to_nodes(stiffness @ displacements, shapes), starts)
    scale = SHIFT * np.trace(large, axis1=1, axis2=2)
    nearest = np.linalg.solve(large + scale[:, None, None] * np.eye(81), forces)
    group = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(cells)))
    held = nearest[group].reshape(len(cells), 27, -1)
    missed = displacements - (shapes @ held).reshape(displacements.shape)
    return np.asarray(np.einsum("cik,cik->ck", missed, stiffness @ missed))


def _from_nodes(matrices: Array, shapes: Array) -> Array:
    """Matrices (c, 81, 81) with the larger cell's displacements for columns."""
    split = matrices.reshape(len(matrices), 81, 27, 3).swapaxes(2, 3)
    product = split.reshape(len(matrices), 243, 27) @ shapes
    return product.reshape(-1, 81, 3, 27).swapaxes(2, 3).reshape(matrices.shape)


def _to_nodes(matrices: Array, shapes: Array) -> Array:
    """Matrices (c, 81, k) with the larger cell's forces for rows."""
    rows = matrices.reshape(len(matrices), 27, -1)
    return (shapes.swapaxes(1, 2) @ rows).reshape(matrices.shape)


def larger_cells(cells: FiniteCells, pairs: Index, edge: int) -> tuple[Index, Index]:
    """Groups (c,) of cells in one larger cell, which hang together in it, and its corners (c, 3).

    `pairs` (p, 2) are the cells that share a face.
    """
    places = cells.grid // edge
    together = pairs[(places[pairs[:, 0]] == places[pairs[:, 1]]).all(axis=1)]
    graph = coo_matrix((np.ones(len(together)), tuple(together.T)), shape=(len(cells),) * 2)
    return connected_components(graph, directed=False)[1].astype(np.int64), edge * places


def losses(model: FiniteCellModel, modes: Array) -> tuple[Array, Array, Index]:
    """Energies (c, k) in each cell that cells of two and of four times its edge cannot represent.

    Returns the energies, and the group (c,) of cells of one size in one place of four times their
    edge.
    """
    cells = model.cells
    pairs, span = face_neighbours(model.hexmesh), cells.span
    kind = _kinds(model)
    # Larger cells would not know where materials change.
    pairs = pairs[kind[pairs[:, 0]] == kind[pairs[:, 1]]]
    twice, fourfold = np.zeros((2, len(cells), modes.shape[1]))
    group = np.zeros(len(cells), dtype=np.int64)
    for size in np.unique(span):
        own = span == size
        for factor, lost in ((2, twice), (4, fourfold)):
            groups, corners = larger_cells(cells, pairs, factor * int(size))
            asked = np.where(np.isin(groups, groups[own]), groups, -1)
            energies = energy_lost(model, modes, asked, corners, factor * int(size))
            lost[own] = energies[own]
        group[own] = groups[own] + group.max(initial=0) + 1
    at_border = kind < 0
    twice[at_border] = fourfold[at_border] = 0.0
    return twice, fourfold, np.unique(group, return_inverse=True)[1].ravel()


def _kinds(model: FiniteCellModel) -> Index:
    """Region (c,) of each cell; -1 of those that several have a part in."""
    elements = model.elements
    if elements.law is None:
        return np.zeros(len(model.cells), dtype=np.int64)
    there = elements.shares.any(axis=2)
    law = np.where(
        there, elements.law, elements.law[np.arange(len(there)), there.argmax(1)][:, None]
    )
    return np.where((law == law[:, :1]).all(axis=1), law[:, 0].astype(np.int64), -1)
