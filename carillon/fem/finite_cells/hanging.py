"""Cells of half the edge beside whole ones: which of their nodes hang, and what is said there.

A cell of half the edge has its corners at nodes of the whole ones beside it, and between them nodes
in the middles of its edges and faces, which hang where a whole cell has that edge or face. A cell
then has, instead of a node that hangs, that node of the whole cell which is as far beyond its own
corner along the axes of the edge or face, and what it says at the node that hangs is what the whole
cell says. So every cell has 27 nodes, and displacements are continuous (octree meshes, as of
Bielak, Ghattas and Kim 2005, with quadratic elements).
"""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index
from carillon.fem.block import CORNER_NODES, NODES
from carillon.fem.element import CORNERS
from carillon.fem.finite_cells.shapes import NODE_PLACES, lagrange

_STRIDE = np.array([1, 3, 9])

BITS = 1 << np.arange(len(NODES), dtype=np.int64)
"""Bit of each node in a kind."""


def kinds_of_cells(octants: NDArray[np.integer], hangs: Flags) -> Index:
    """Kind (c,) of each cell: its place (c,) in one of twice the edge, and which (c, 27) hang.

    It is 0 where nothing hangs, whatever the place.
    """
    mask = hangs @ BITS
    return np.where(mask > 0, mask + octants * 2 ** len(NODES), 0)


def node_places(kinds: Index) -> Index:
    """Places (c, 27, 3) of the nodes from the lowest corner of each cell, in halves of its edge."""
    octants, hangs = _parts(kinds)
    return np.where(hangs[:, :, None], _beyond()[octants], NODES)


def node_weights(kinds: Index) -> Array:
    """Weights (c, 27, 27) of the nodes, the columns, in what a cell says at its own 27 places."""
    octants, hangs = _parts(kinds)
    return np.where(hangs[:, :, None], _weights()[octants], np.eye(len(NODES)))


def corners_of(
    kinds: Index, nodes: NDArray[np.integer]
) -> tuple[NDArray[np.int32], NDArray[np.uint8]]:
    """Corners (c, 8) of cells with these nodes (c, 27), and which of them hang, in bits (c,).

    Between cells of two sizes a corner hangs in the middle of a whole cell's edge or face, and the
    whole cell's corner stands for it; see `carillon.fem.geometry.hanging`.
    """
    octants, hangs = _parts(kinds)
    # Along an axis in which a corner is in the middle of the whole cell, its end is beyond.
    inner = 1 - CORNERS[octants][:, None] == CORNERS
    slots = np.where(inner, 1, 2 * CORNERS) @ _STRIDE
    hanging = np.take_along_axis(hangs, slots, axis=1)
    corners = np.where(hanging, np.take_along_axis(nodes, slots, axis=1), nodes[:, CORNER_NODES])
    bits = np.packbits(hanging, axis=1, bitorder="little")[:, 0]
    return corners.astype(np.int32), bits


def at_nodes(matrices: Array, kinds: Index) -> Array:
    """Matrices (c, 27 d, 27 d) of cells between their nodes, from those between their own places.

    Displacement components follow each other at every node.
    """
    chosen = np.flatnonzero(kinds)
    if len(chosen):
        alike, which = np.unique(kinds[chosen], return_inverse=True)
        components = np.eye(matrices.shape[1] // len(NODES))
        for number, weights in enumerate(node_weights(alike)):
            cells = chosen[which == number]
            turned = np.kron(weights, components)
            matrices[cells] = turned.T @ matrices[cells] @ turned
    return matrices


def _parts(kinds: Index) -> tuple[Index, Flags]:
    return kinds >> len(NODES), (kinds[:, None] & BITS) > 0


@cache
def _beyond() -> Index:
    """Places (8, 27, 3) of what replaces each node that hangs, see `node_places`."""
    ends = np.where(CORNERS.astype(bool), -2, 4)
    return np.where(NODES == 1, ends[:, None, :], NODES)


@cache
def _weights() -> Array:
    """Weights (8, 27, 27) of the nodes in what a cell says at those that hang."""
    table: Array = np.ones((8, len(NODES), len(NODES)))
    for octant, corner in enumerate(CORNERS):
        for axis in range(3):
            # What the whole cell's nodes say in the middle, in this cell's order of them.
            middle = lagrange(NODE_PLACES, np.array([0.25 + 0.5 * corner[axis]]))[0]
            order = [1, 0, 2] if corner[axis] else [0, 2, 1]
            along: Any = np.eye(3)
            along[1] = middle[order]
            table[octant] *= along[NODES[:, None, axis], NODES[None, :, axis]]
    return table
