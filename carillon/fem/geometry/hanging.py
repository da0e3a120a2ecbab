"""Kinds of elements in a mesh of which some 2x2x2 blocks stay fine, and their hanging nodes.

Local corner k of the fine cell at position c of its block is the block's corner where k = c, the
middle of an edge where k and c differ along one axis, and the middle of a face where along two. If
it hangs between coarse nodes, the cell has the block's corner k for a node instead, and the value
there is the mean of the cell's nodes c ^ y, for all sets y of the axes in which k and c differ.
These are corners of the block all, since the middle of a face hangs only together with the middles
of its edges. So every element has eight nodes (octree meshes, as of Bielak, Ghattas and Kim 2005).
"""

from functools import cache

import numpy as np

from carillon.arrays import frozen

WHOLE = 8 * 256
"""Kind of an element that is no fine cell: of twice the edge, without hanging corners."""

_AXES = np.arange(8)[:, None] >> np.arange(3) & 1


def kinds_of_cells(grid: np.ndarray, span: np.ndarray, hanging: np.ndarray) -> np.ndarray:
    """Kind (m,) int32 of each element: ``256 * position + hanging`` of a fine cell, or `WHOLE`.

    `grid`, `span`, `hanging`: see `HexMesh`.
    """
    position = (grid & 1) @ np.array([1, 2, 4])
    return np.where(span == 1, 256 * position + hanging, WHOLE).astype(np.int32)


@cache
def node_places() -> np.ndarray:
    """Places (kinds, 8, 3) of the nodes in the block, 0 to 2 along each axis."""
    places = np.broadcast_to(2 * _AXES, (WHOLE + 1, 8, 3)).copy()
    hangs = _hangs()[:, :, None]
    own = (_AXES[:, None] + _AXES)[:, None]
    places[:WHOLE] = np.where(hangs, 2 * _AXES, own).reshape(WHOLE, 8, 3)
    return frozen(places)


@cache
def node_weights() -> np.ndarray:
    """Weights (kinds, 8, 8) of an element's nodes, the columns, in the values at its corners."""
    weights = np.broadcast_to(np.eye(8), (WHOLE + 1, 8, 8)).copy()
    table = weights[:WHOLE].reshape(8, 256, 8, 8)
    for position in range(8):
        for corner in range(8):
            axes = position ^ corner
            ends = [position ^ y for y in range(8) if y & ~axes == 0]
            mean = np.zeros(8)
            mean[ends] = 1.0 / len(ends)
            table[position, _hangs()[:, corner], corner] = mean
    return frozen(weights)


@cache
def makes_sense() -> np.ndarray:
    """Which kinds (kinds,) there are: no block's corner or middle hangs, no face without edges."""
    result = np.ones((8, 256), dtype=bool)
    for position in range(8):
        hangs = _hangs()[:, position ^ np.arange(8)]  # by the axes in which the corner differs
        result[position] &= ~hangs[:, 0] & ~hangs[:, 7]
        for a, b in ((1, 2), (1, 4), (2, 4)):
            result[position] &= ~hangs[:, a | b] | (hangs[:, a] & hangs[:, b])
    return np.append(result.ravel(), True)


def _hangs() -> np.ndarray:
    """Whether each local corner hangs (256, 8), for every mask."""
    return (np.arange(256)[:, None] >> np.arange(8) & 1).astype(bool)
