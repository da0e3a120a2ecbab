"""Blocks of 2x2x2 fine cells, the coarse mesh they form, and the interpolation between both.

Every face-connected part of a block's cells is an element of its own, and elements share a coarse
node only where cells of different blocks meet. So parts that touch nowhere in the fine mesh stay
apart in the coarse one (Nesme, Kry, Jerabkova and Faure 2009; virtual nodes of Molino, Bao and
Fedkiw 2004). Some blocks may be divided: their cells stay elements, of half the edge.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import scipy.sparse as sp

from carillon.fem.geometry.faces import face_neighbours
from carillon.fem.geometry.hanging import node_weights
from carillon.fem.geometry.hexmesh import CORNER_OFFSETS, HexMesh, distinct_places
from carillon.fem.geometry.joining import Parts, coarse_mesh, corner_weights


@dataclass(frozen=True, eq=False)
class Blocks:
    """The coarse mesh over a fine one: an element for each part of a block that holds material."""

    fine: HexMesh
    coarse: HexMesh
    """Mesh of the elements, edge twice the fine one, the same origin; a mixed mesh if some blocks
    are divided. Elements of one block, and nodes of one place, follow each other."""
    fine_of_block: np.ndarray
    """(mc, 8) int32: index of the fine cell at position ``x + 2*y + 4*z`` of an element, -1 where
    it holds none."""
    contacts: np.ndarray
    """(mc,) uint8: bit d tells whether the element meets another one at face d of
    `faces.FACE_CORNERS`: a face of its fine cells is one of the other's."""

    @property
    def mask(self) -> np.ndarray:
        """Which of an element's eight cells are filled, (mc, 8) bool."""
        return self.fine_of_block >= 0

    @property
    def is_fine(self) -> np.ndarray:
        """Which elements are fine cells of a divided block, (mc,) bool."""
        span = self.coarse.span
        return np.zeros(len(self.contacts), dtype=bool) if span is None else span == 1

    @property
    def pattern(self) -> np.ndarray:
        """The same as bits, (mc,) uint8."""
        return np.packbits(self.mask, axis=1, bitorder="little").ravel()


@cache
def parts_of_patterns() -> np.ndarray:
    """Number (256, 8) of the face-connected part of each cell, for every void pattern.

    Parts are numbered by their first cells; void cells have 0 and mean nothing.
    """
    from scipy.sparse.csgraph import connected_components  # Its import takes long.

    beside = np.abs(CORNER_OFFSETS[:, None] - CORNER_OFFSETS).sum(axis=2) == 1
    numbers = np.zeros((256, 8), dtype=np.int64)
    for pattern in range(256):
        cells = np.flatnonzero(pattern >> np.arange(8) & 1)
        if len(cells):
            numbers[pattern, cells] = connected_components(beside[np.ix_(cells, cells)])[1]
    return numbers


def blocks_from_mesh(fine: HexMesh, refined: np.ndarray | None = None) -> Blocks:
    """Pair `fine` with its coarse mesh; a block starts at every even cell coordinate.

    `refined` (mc,) bool: elements of the coarse mesh, as it is without this, that shall be fine;
    the other parts of their blocks become so as well. With any, `coarse` is a mixed mesh.

    Examples
    --------
    >>> from carillon.fem.geometry import hexmesh_from_grid
    >>> fine = hexmesh_from_grid(np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0]]), np.zeros(3), 0.5)
    >>> blocks = blocks_from_mesh(fine)
    >>> blocks.coarse.n_cells, blocks.fine_of_block[:, :2].tolist(), blocks.contacts.tolist()
    (2, [[0, 1], [2, -1]], [2, 1])
    >>> mixed = blocks_from_mesh(fine, np.array([False, True])).coarse
    >>> mixed.span.tolist(), mixed.edge, mixed.n_nodes
    ([2, 1], 0.5, 12)
    """
    grid, block = distinct_places(fine.grid >> 1)
    position = (fine.grid & 1) @ np.array([1, 2, 4])
    pattern = np.bincount(block, 1 << position).astype(np.int64)
    part = parts_of_patterns()[pattern[block], position]
    places, part = np.unique(8 * block + part, return_inverse=True)
    owner = places // 8
    divided = np.zeros(len(grid), dtype=bool)
    if refined is not None:
        if refined.shape != owner.shape:
            raise ValueError(f"refined has shape {refined.shape}, expected {owner.shape}")
        divided[owner[refined]] = True
    is_fine = divided[block]
    # The elements: parts of blocks, and cells of divided ones.
    numbers, element = np.unique(8 * part + np.where(is_fine, position, 0), return_inverse=True)
    fine_of_block = np.full((len(numbers), 8), -1, dtype=np.int32)
    fine_of_block[element, position] = np.arange(fine.n_cells, dtype=np.int32)
    parts = Parts(fine, position, part, owner, grid)
    coarse = coarse_mesh(parts, numbers // 8, element, is_fine)
    return Blocks(fine, coarse, fine_of_block, _contacts(fine, element, len(numbers)))


def blocks_with_coarse(fine: HexMesh, coarse: HexMesh) -> Blocks | None:
    """The blocks of `fine` whose mesh is `coarse`, plain or mixed; None if they are not related."""
    steps = 2 if coarse.span is None else 1
    if fine.span is not None or not np.isclose(coarse.edge, steps * fine.edge):
        return None
    blocks = blocks_from_mesh(fine)
    if coarse.span is not None:
        divided = coarse.grid[coarse.span == 1] >> 1
        everywhere = np.concatenate([blocks.coarse.grid, divided])
        place = np.unique(everywhere, axis=0, return_inverse=True)[1].ravel()
        count = blocks.coarse.n_cells
        blocks = blocks_from_mesh(fine, np.isin(place[:count], place[count:]))
    same = np.array_equal(blocks.coarse.cells, coarse.cells)
    same = same and np.array_equal(blocks.coarse.node_grid, coarse.node_grid)
    return blocks if same else None


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
    the mean of the 2, 4 or 8 coarse nodes around it, which is what a hanging node takes as well.
    Where parts of one block meet at an edge only, it is the mean of what they say. Displacements
    use ``scipy.sparse.kron(prolongation(blocks), scipy.sparse.identity(3))``.
    """
    fine, coarse = blocks.fine, blocks.coarse
    element, position = np.nonzero(blocks.mask)
    nodes = fine.cells[blocks.fine_of_block[element, position]]
    # Each fine node once for every element that has it, but once for all fine cells, which agree.
    who = np.where(blocks.is_fine, coarse.n_cells, np.arange(coarse.n_cells))
    pairs = (nodes.astype(np.int64) * (coarse.n_cells + 1) + who[element, None]).ravel()
    pairs, first = np.unique(pairs, return_index=True)
    cell, corner = np.divmod(first, 8)
    node, element = pairs // (coarse.n_cells + 1), element[cell]
    weights = corner_weights()[position[cell], corner]
    if coarse.kinds is not None:
        cells = np.flatnonzero(blocks.is_fine[element])
        weights[cells] = node_weights()[coarse.kinds[element[cells]], corner[cells]]
    weights = weights / np.bincount(node)[node][:, None]
    rows = np.repeat(node, 8)
    shape = (fine.n_nodes, coarse.n_nodes)
    matrix = sp.csr_matrix((weights.ravel(), (rows, coarse.cells[element].ravel())), shape=shape)
    matrix.eliminate_zeros()
    return matrix
