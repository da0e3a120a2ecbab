"""Blocks of 2x2x2 fine cells, the coarse mesh they form, and the interpolation between both.

Every face-connected part of a block's cells is an element of its own, and elements share a coarse
node only where cells of different blocks meet. So parts that touch nowhere in the fine mesh stay
apart in the coarse one (Nesme, Kry, Jerabkova and Faure 2009; virtual nodes of Molino, Bao and
Fedkiw 2004).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from carillon.fem.geometry.faces import face_neighbours
from carillon.fem.geometry.hexmesh import CORNER_OFFSETS, HexMesh


@dataclass(frozen=True, eq=False)
class Blocks:
    """The coarse mesh over a fine one: an element for each part of a block that holds material.

    Attributes
    ----------
    fine
        The fine mesh.
    coarse
        Mesh of the elements, edge twice the fine one, the same origin. Elements of one block, and
        nodes of one place, follow each other.
    fine_of_block : (mc, 8) int32
        Index of the fine cell at position ``x + 2*y + 4*z`` of an element, -1 where it holds none.
    contacts : (mc,) uint8
        Bit d tells whether the element meets another one in direction ``faces.DIRECTIONS[d]``: a
        face of its fine cells is one of the other's.
    """

    fine: HexMesh
    coarse: HexMesh
    fine_of_block: np.ndarray
    contacts: np.ndarray

    @property
    def mask(self) -> np.ndarray:
        """Which of an element's eight cells are filled, (mc, 8) bool."""
        return self.fine_of_block >= 0

    @property
    def pattern(self) -> np.ndarray:
        """The same as bits, (mc,) uint8."""
        return np.packbits(self.mask, axis=1, bitorder="little").ravel()


@cache
def parts_of_patterns() -> np.ndarray:
    """Number (256, 8) of the face-connected part of each cell, for every void pattern.

    Parts are numbered by their first cells; void cells have 0 and mean nothing.
    """
    beside = np.abs(CORNER_OFFSETS[:, None] - CORNER_OFFSETS).sum(axis=2) == 1
    numbers = np.zeros((256, 8), dtype=np.int64)
    for pattern in range(256):
        cells = np.flatnonzero(pattern >> np.arange(8) & 1)
        if len(cells):
            numbers[pattern, cells] = connected_components(beside[np.ix_(cells, cells)])[1]
    return numbers


@cache
def corner_weights() -> np.ndarray:
    """Trilinear weights (8, 8, 8) of a block's corners at each corner of each fine cell."""
    halves = (CORNER_OFFSETS[:, None] + CORNER_OFFSETS)[:, :, None] / 2.0
    return np.asarray(np.where(CORNER_OFFSETS, halves, 1.0 - halves).prod(axis=3))


def blocks_from_mesh(fine: HexMesh) -> Blocks:
    """Pair `fine` with its coarse mesh; a block starts at every even cell coordinate.

    Examples
    --------
    >>> from carillon.fem.geometry import hexmesh_from_grid
    >>> fine = hexmesh_from_grid(np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]]), np.zeros(3), 0.5)
    >>> blocks = blocks_from_mesh(fine)
    >>> blocks.coarse.n_cells, blocks.fine_of_block[:, :2].tolist(), blocks.contacts.tolist()
    (2, [[0, 1], [2, -1]], [2, 1])
    """
    grid, block = np.unique((fine.grid >> 1)[:, ::-1], axis=0, return_inverse=True)
    grid, block = grid[:, ::-1], block.ravel()  # Ordered by (z, y, x).
    position = (fine.grid & 1) @ np.array([1, 2, 4])
    pattern = np.bincount(block, 1 << position).astype(np.int64)
    part = parts_of_patterns()[pattern[block], position]
    places, element = np.unique(8 * block + part, return_inverse=True)
    fine_of_block = np.full((len(places), 8), -1, dtype=np.int32)
    fine_of_block[element, position] = np.arange(fine.n_cells, dtype=np.int32)
    owner = places // 8
    cells, node_grid = _joined_corners(fine, element, position, owner, grid[owner])
    coarse = HexMesh(
        cells=cells.astype(np.int32),
        grid=grid[owner].astype(np.int32),
        node_grid=node_grid.astype(np.int32),
        origin=fine.origin,
        edge=2 * fine.edge,
    )
    return Blocks(fine, coarse, fine_of_block, _contacts(fine, element, len(places)))


def _joined_corners(
    fine: HexMesh, element: np.ndarray, position: np.ndarray, owner: np.ndarray, grid: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (mc, 8) of the elements and their places (n, 3), ordered by (z, y, x).

    What a fine node that cells of two blocks share is interpolated from, both blocks have in
    common. Cells of one block that share an edge only are not joined by it.
    """
    # A block's cells meet other blocks at nodes that lie on a plane between blocks.
    cell, corner = np.nonzero((fine.node_grid[fine.cells] & 1 == 0).any(axis=2))
    node = fine.cells[cell, corner]
    spread = corner_weights()[position[cell], corner] > 0.0
    at, coarse_corner = np.nonzero(spread)
    lower = fine.node_grid[node[at]] & 1 == 1
    # The place of the coarse corner, seen from the fine node, is the same in every block.
    offset = (CORNER_OFFSETS[coarse_corner] * lower) @ np.array([1, 2, 4])
    keys = 8 * node[at].astype(np.int64) + offset
    ends = 8 * element[cell[at]] + coarse_corner
    shared, key = np.unique(keys, return_inverse=True)
    key = key.ravel()
    # Only keys with elements of two blocks join anything.
    blocks = owner[element[cell[at]]]
    low, high = np.full(len(shared), len(owner)), np.full(len(shared), -1)
    np.minimum.at(low, key, blocks)
    np.maximum.at(high, key, blocks)
    joins = (low != high)[key]
    corners = 8 * len(owner)
    graph = sp.coo_matrix(
        (np.ones(joins.sum()), (ends[joins], corners + key[joins])),
        shape=(corners + len(shared),) * 2,
    )
    label = connected_components(graph, directed=False)[1][:corners]
    _, first, number = np.unique(label, return_index=True, return_inverse=True)
    places = (grid[:, None, :] + CORNER_OFFSETS).reshape(-1, 3)[first]
    order = np.lexsort((first, *places.T))
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return rank[number].reshape(-1, 8), places[order]


def _contacts(fine: HexMesh, element: np.ndarray, count: int) -> np.ndarray:
    pairs = face_neighbours(fine)
    lower, upper = element[pairs].T
    apart = lower != upper
    axis = (fine.grid[pairs[:, 1]] - fine.grid[pairs[:, 0]]).argmax(axis=1)
    contacts = np.zeros(count, dtype=np.uint8)
    for ends, side in ((lower, 1), (upper, 0)):
        bits = (1 << (2 * axis[apart] + side)).astype(np.uint8)
        np.bitwise_or.at(contacts, ends[apart], bits)
    return contacts


def prolongation(blocks: Blocks) -> sp.csr_matrix:
    """Trilinear interpolation from coarse to fine nodes, (n_fine_nodes, n_coarse_nodes).

    A fine node on a coarse node takes its value; on an edge, face or in the middle of an element,
    the mean of the 2, 4 or 8 coarse nodes around it. Where parts of one block meet at an edge only,
    it is the mean of what they say. Displacements use
    ``scipy.sparse.kron(prolongation(blocks), scipy.sparse.identity(3))``.
    """
    fine, coarse = blocks.fine, blocks.coarse
    element, position = np.nonzero(blocks.mask)
    nodes = fine.cells[blocks.fine_of_block[element, position]]
    # Each fine node once for every element that has it.
    pairs = (nodes.astype(np.int64) * coarse.n_cells + element[:, None]).ravel()
    pairs, first = np.unique(pairs, return_index=True)
    cell, corner = np.divmod(first, 8)
    node, element = np.divmod(pairs, coarse.n_cells)
    weights = corner_weights()[position[cell], corner]
    weights = weights / np.bincount(node)[node][:, None]
    rows = np.repeat(node, 8)
    shape = (fine.n_nodes, coarse.n_nodes)
    matrix = sp.csr_matrix((weights.ravel(), (rows, coarse.cells[element].ravel())), shape=shape)
    matrix.eliminate_zeros()
    return matrix
