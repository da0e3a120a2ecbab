"""Which nodes of cells are one: those of the faces where their insides meet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Flags, Index
from carillon.fem.block import NODES
from carillon.fem.geometry.facets import connected

_COUNT = len(NODES)
_STRIDE = np.array([1, 3, 9])


@dataclass(frozen=True)
class Faces:
    """Cells that meet across faces."""

    alike: Index
    """(m, 3) two cells of one size, the lower one first, and the axis across the face."""
    unlike: Index
    """(k, 4) a cell, one of half its edge, the axis, and on which side of that axis the latter's
    face is: 0 or 2."""

    def chosen(self, kept: Flags) -> Faces:
        """Those between cells that are kept, by their new numbers."""
        number = np.cumsum(kept) - 1
        faces = []
        for each in (self.alike, self.unlike):
            stays = each[kept[each[:, :2]].all(axis=1)]
            faces.append(np.column_stack([number[stays[:, :2]], stays[:, 2:]]))
        return Faces(*faces)

    def pieces(self, count: int) -> Index:
        """Piece (count,) of the solid that each cell is of."""
        pairs = np.concatenate([self.alike[:, :2], self.unlike[:, :2]])
        return connected(count, pairs[:, 0], pairs[:, 1])


def joined_nodes(corner: Index, span: Index, faces: Faces, slight: Flags) -> tuple[Index, Index]:
    """Nodes (c, 27) of cells, and the places (n, 3) of the nodes, ordered by (z, y, x).

    Some cells are so slight (p,) that they are not among the c, but they hold others together.
    `corner`, `span` (c, 3), (c,): lowest corners and edges, in steps of which an edge has an even
    number.
    """
    count = _COUNT * len(corner)
    own = _COUNT * np.arange(len(corner))[:, None] + np.arange(_COUNT)
    joins = [_of_alike(own, faces.alike)]
    hanging, beyond, same = _of_unlike(own, corner, span, faces.unlike)
    hangs_from_cell = ~slight[beyond // _COUNT]
    hanging, beyond = hanging[hangs_from_cell], beyond[hangs_from_cell]
    joins.append(same)
    label = connected(count, *np.concatenate(joins, axis=1))
    # A node that hangs between two cells hangs from nodes that they share.
    order = np.argsort(label[hanging], kind="stable")
    follows = np.flatnonzero(np.diff(label[hanging][order]) == 0)
    joins.append(np.stack([beyond[order][follows], beyond[order][follows + 1]]))
    label = connected(count, *np.concatenate(joins, axis=1))
    replaced = np.arange(count)
    replaced[label[hanging]] = label[beyond]
    hangs = np.zeros(count, dtype=bool)
    hangs[label[hanging]] = True
    nodes = np.where(hangs[label], replaced[label], label)[own[~slight]]
    places = np.repeat(corner, _COUNT, axis=0) + (NODES * (span[:, None, None] // 2)).reshape(-1, 3)
    return _ordered(nodes, label, np.where(hangs[label, None], -1, places))


def _ordered(
    nodes: NDArray[np.integer], label: NDArray[np.integer], places: Index
) -> tuple[Index, Index]:
    """Nodes numbered by place, and in one place by the cells that have them."""
    own = np.flatnonzero(places[:, 0] >= 0)
    first = np.full(len(label), -1)
    first[label[own][::-1]] = own[::-1]
    used = np.unique(nodes)
    order = np.lexsort((first[used], *places[first[used]].T))
    rank = np.empty(len(label), dtype=np.int64)
    rank[used[order]] = np.arange(len(used))
    return rank[nodes], places[first[used]][order]


def _of_alike(own: Index, faces: Index) -> Index:
    joins = [np.empty((2, 0), dtype=np.int64)]
    for axis in range(3):
        below, above, _ = faces[faces[:, 2] == axis].T
        low, high = (np.flatnonzero(NODES[:, axis] == side) for side in (0, 2))
        joins.append(np.stack([own[below][:, high].ravel(), own[above][:, low].ravel()]))
    return np.concatenate(joins, axis=1)


def _of_unlike(own: Index, corner: Index, span: Index, faces: Index) -> tuple[Index, Index, Index]:
    """Nodes that hang (h,), those (h,) that replace them, and pairs (2, j) that are one."""
    hanging, beyond = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
    same = [np.empty((2, 0), dtype=np.int64)]
    for axis in range(3):
        for side in (0, 2):
            chosen = faces[(faces[:, 2] == axis) & (faces[:, 3] == side)]
            whole, half = chosen[:, 0, None], chosen[:, 1, None]
            slots = np.flatnonzero(NODES[:, axis] == side)
            step = (span[half] // 2)[:, :, None]
            # In halves of the small cell's edge: the whole cell has nodes at 0, 2 and 4.
            place = (corner[half] - corner[whole]) // step + NODES[slots]
            hangs = (place & 1).any(axis=2)
            place = np.where(place & 1, 4 * (place == 1), place) // 2
            target = own[whole[:, 0]][np.arange(len(chosen))[:, None], place @ _STRIDE]
            ends = own[half[:, 0]][:, slots]
            hanging.append(ends[hangs])
            beyond.append(target[hangs])
            same.append(np.stack([ends[~hangs], target[~hangs]]))
    return np.concatenate(hanging), np.concatenate(beyond), np.concatenate(same, axis=1)
