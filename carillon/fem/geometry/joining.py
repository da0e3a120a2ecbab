"""Which corners of coarse elements are one node, and the mesh that follows."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from carillon.fem.geometry.facets import connected
from carillon.fem.geometry.hexmesh import CORNER_OFFSETS, HexMesh


@cache
def corner_weights() -> np.ndarray:
    """Trilinear weights (8, 8, 8) of a block's corners at each corner of each fine cell."""
    halves = (CORNER_OFFSETS[:, None] + CORNER_OFFSETS)[:, :, None] / 2.0
    return np.asarray(np.where(CORNER_OFFSETS, halves, 1.0 - halves).prod(axis=3))


@dataclass(frozen=True)
class Parts:
    """The parts of the blocks over a fine mesh."""

    fine: HexMesh
    position: np.ndarray
    part: np.ndarray
    """(m,) position of each cell in its block, and its part."""
    owner: np.ndarray
    """(parts,) block of each part."""
    grid: np.ndarray
    """(blocks, 3) integer coordinates of the blocks."""


def coarse_mesh(
    parts: Parts, part: np.ndarray, element: np.ndarray, is_fine: np.ndarray
) -> HexMesh:
    """Mesh of elements that lie in `part` (mc,), from those (m,) of the fine cells."""
    fine, corners = parts.fine, 8 * len(parts.owner)
    grid = 2 * parts.grid[parts.owner]
    hanging = _hanging_nodes(fine, parts.position, is_fine)
    # Of the fine nodes these alone stay nodes; all others are corners of blocks.
    alone = is_fine[:, None] & ((fine.node_grid & 1).any(axis=1) & ~hanging)[fine.cells]
    own = np.unique(fine.cells[alone])
    ends = 8 * part[:, None] + np.arange(8)
    cell, corner = np.nonzero(alone)
    ends[element[cell], corner] = corners + np.searchsorted(own, fine.cells[alone])
    label = np.append(_joined_corners(parts, alone), -1 - np.arange(len(own)))
    _, first, number = np.unique(label[ends], return_index=True, return_inverse=True)
    at_corners = (grid[:, None] + 2 * CORNER_OFFSETS).reshape(-1, 3)
    places = np.concatenate([at_corners, fine.node_grid[own]])[ends.ravel()[first]]
    order = np.lexsort((first, *places.T))
    rank = np.empty(len(order), dtype=np.int32)
    rank[order] = np.arange(len(order))
    cells = rank[number].reshape(-1, 8)
    places, grid = places[order].astype(np.int32), grid[part].astype(np.int32)
    if not is_fine.any():
        return HexMesh(cells, grid // 2, places // 2, fine.origin, 2 * fine.edge)
    span, mask = np.full(len(part), 2, dtype=np.uint8), np.zeros(len(part), dtype=np.uint8)
    grid[element[is_fine]] = fine.grid[is_fine]
    span[element[is_fine]] = 1
    bits = np.packbits(hanging[fine.cells[is_fine]], axis=1, bitorder="little")
    mask[element[is_fine]] = bits.ravel()
    return HexMesh(cells, grid, places, fine.origin, fine.edge, span, mask)


def _hanging_nodes(fine: HexMesh, position: np.ndarray, divided: np.ndarray) -> np.ndarray:
    """Which nodes (n,) hang, as coarse elements are beside them, of fine cells that are `divided`.

    `position` (m,) is that of each cell in its block.
    """
    beside = np.zeros(fine.n_nodes, dtype=bool)
    beside[fine.cells[~divided]] = True
    kept = np.zeros(fine.n_nodes, dtype=bool)
    kept[fine.cells[divided]] = True
    hanging = beside & kept & (fine.node_grid & 1).any(axis=1)
    # The middle of a face is the mean of its corners: the edges of every cell there hang as well.
    # They draw no other face along, so once is enough.
    cells, corner = fine.cells[divided], position[divided]
    own = np.arange(len(cells))
    for a, b in ((1, 2), (1, 4), (2, 4)):
        follow = hanging[cells[own, corner ^ a ^ b]]
        for edge in (a, b):
            hanging[cells[own, corner ^ edge][follow]] = True
    return hanging


def _joined_corners(parts: Parts, alone: np.ndarray) -> np.ndarray:
    """Label (8 parts,) of each corner of the parts, equal where they are one node.

    What a fine node that cells of two blocks share is interpolated from, both blocks have in
    common. Cells of one block that share an edge only are not joined by it. Corners (m, 8) of cells
    that stand `alone` are not interpolated.
    """
    # A block's cells meet other blocks at nodes that lie on a plane between blocks.
    fine, position = parts.fine, parts.position
    between = (fine.node_grid & 1 == 0).any(axis=1)
    cell, corner = np.nonzero(between[fine.cells] & ~alone)
    node = fine.cells[cell, corner]
    spread = corner_weights()[position[cell], corner] > 0.0
    at, coarse_corner = np.nonzero(spread)
    lower = fine.node_grid[node[at]] & 1 == 1
    # The place of the coarse corner, seen from the fine node, is the same in every block.
    offset = (CORNER_OFFSETS[coarse_corner] * lower) @ np.array([1, 2, 4])
    key = 8 * node[at].astype(np.int64) + offset
    part = parts.part[cell[at]]
    ends = 8 * part + coarse_corner
    keys = 8 * fine.n_nodes
    # Only keys with parts of two blocks join anything.
    blocks = parts.owner[part]
    low, high = np.full(keys, len(parts.owner)), np.full(keys, -1)
    np.minimum.at(low, key, blocks)
    np.maximum.at(high, key, blocks)
    joins = (low != high)[key]
    corners = 8 * len(parts.owner)
    return connected(corners + keys, ends[joins], corners + key[joins])[:corners]
