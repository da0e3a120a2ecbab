"""Small cells beside larger ones: which nodes they have there, and what these say in the cell.

A small cell is an octant of a parent of twice its edge. Where its parent's face or edge is that of
a whole cell, too, the small cell's own nodes would hang there. In their place it has all nodes that
the whole cell has on this face or edge, as many as its own. What these say at its own places is
what the whole cell says, so that displacements are continuous, and every cell has the same number
of nodes (octree meshes, as of Bielak, Ghattas and Kim 2005, of any degree).
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index, frozen
from carillon.fem.element import CORNERS
from carillon.fem.finite_cells.basis import basis

FACES, EDGES, INNER = slice(0, 3), slice(3, 6), slice(6, 12)
"""Columns of what hangs: outer faces across x, y, z; outer edges along x, y, z; and the two edges
along each axis that are in one outer face only, first that in the face across the next axis. The
latter hang without their face in files of older versions alone."""
COLUMNS = 12
_BITS = 1 << np.arange(COLUMNS)
_KEPT = 512
"""Number of kinds."""


def kinds_of_cells(octant: Index, hangs: Flags) -> NDArray[np.int32]:
    """Kind (c,) of each cell: its octant (c,) in its parent, and what hangs (c, 6 or 12) of it.

    Edges of faces that hang do so, too. It is 0 where nothing hangs, whatever the octant.
    """
    mask = complete(hangs) @ _BITS
    return np.where(mask > 0, octant + 8 * mask, 0).astype(np.int32)


def complete(hangs: Flags) -> Flags:
    """Faces and edges of cells that hang (c, 12): hanging faces hang their outer edges only."""
    result = np.zeros((len(hangs), COLUMNS), dtype=bool)
    result[:, : hangs.shape[1]] = hangs
    for axis in range(3):
        for step in (1, 2):
            along = (axis + step) % 3
            result[:, 3 + along] |= hangs[:, axis]
            # Of an edge along y the next axis is z: the face across x is that across the second.
            result[:, 6 + 2 * along + (step == 1)] &= ~hangs[:, axis]
    return result


def parts_of_kind(kind: int) -> tuple[Index, Flags]:
    """Octant (3,), in bits, of cells of a kind, and what hangs (12,)."""
    return CORNERS[kind % 8], (kind // 8 & _BITS) > 0


@lru_cache(_KEPT)
def node_places(degree: int, kind: int) -> Index:
    """Places (n, 3) of the nodes from the cell's lowest corner, in steps of its edge / `degree`."""
    octant, hangs = parts_of_kind(kind)
    nodes, outer = basis(degree).nodes, degree * octant
    places = nodes.copy()
    if kind:
        at_end = nodes == outer
        for axis in range(3):
            others = [(axis + 1) % 3, (axis + 2) % 3]
            outer_in = at_end[:, others]
            # Along this axis a node is the parent's, on a face beside it or an edge along it.
            on_face = (outer_in & hangs[FACES][others]).any(axis=1)
            on_edge = outer_in.all(axis=1) & hangs[EDGES][axis]
            inner_in = (nodes == degree - outer)[:, others]
            inner = outer_in & inner_in[:, ::-1] & hangs[INNER][2 * axis : 2 * axis + 2]
            moved = 2 * nodes[:, axis] - outer[axis]
            places[:, axis] = np.where(on_face | on_edge, moved, nodes[:, axis])
            # Two of these edges may end at one corner, which stays: what is between goes beyond.
            between = inner.any(axis=1) & ~on_face & (nodes[:, axis] == degree // 2)
            places[between, axis] = 2 * degree - 3 * outer[axis]
    return frozen(places)


@lru_cache(_KEPT)
def node_weights(degree: int, kind: int) -> Array:
    """Weights (n, n) of the nodes, the columns, in what a cell says at its own n places."""
    at_nodes = basis(degree).functions(node_places(degree, kind) / degree)
    weights = np.linalg.inv(at_nodes)
    weights[np.abs(weights) < 1e-13] = 0.0
    return frozen(weights)


def places_of_kinds(degree: int, kinds: NDArray[np.integer]) -> Index:
    """Places (c, n, 3) of the nodes of cells of these kinds (c,), see `node_places`."""
    alike, which = np.unique(kinds, return_inverse=True)
    return np.array([node_places(degree, int(kind)) for kind in alike])[which.ravel()]


def at_nodes(degree: int, matrices: Array, kinds: NDArray[np.integer]) -> Array:
    """Matrices (c, n d, n d) of cells between their nodes, from those between their own places.

    Displacement components follow each other at every node. The given ones are overwritten.
    """
    chosen = np.flatnonzero(kinds)
    if not len(chosen):
        return matrices
    count = basis(degree).n_nodes
    components = matrices.shape[1] // count
    alike, which = np.unique(kinds[chosen], return_inverse=True)
    for number, kind in enumerate(alike):
        cells = chosen[which.ravel() == number]
        weights = node_weights(degree, int(kind))
        # K = T^T K T, where T acts on every component alike.
        half = weights.T @ matrices[cells].reshape(len(cells), count, -1)
        turned = half.reshape(len(cells), count * components, -1).transpose(0, 2, 1)
        whole = weights.T @ turned.reshape(len(cells), count, -1)
        matrices[cells] = whole.reshape(len(cells), count * components, -1)
    return matrices


def own_values(degree: int, values: Array, kinds: NDArray[np.integer]) -> Array:
    """Values (c, n, k) at the cells' own places, from those (c, n, k) of their nodes."""
    return _turned(degree, values, kinds, False)


def from_own(degree: int, values: Array, kinds: NDArray[np.integer]) -> Array:
    """Weights or forces (c, n, k) of nodes, from those (c, n, k) of the cells' own places."""
    return _turned(degree, values, kinds, True)


def _turned(degree: int, values: Array, kinds: NDArray[np.integer], transposed: bool) -> Array:
    chosen = np.flatnonzero(kinds)
    if not len(chosen):
        return values
    result = values.copy()
    alike, which = np.unique(kinds[chosen], return_inverse=True)
    for number, kind in enumerate(alike):
        cells = chosen[which.ravel() == number]
        weights = node_weights(degree, int(kind))
        result[cells] = (weights.T if transposed else weights) @ values[cells]
    return result
