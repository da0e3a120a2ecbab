"""Which nodes of cells are one: those of the faces where their insides meet."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Flags, Index
from carillon.fem.finite_cells.basis import Basis, voxel_places
from carillon.fem.finite_cells.hanging import kinds_of_cells, places_of_kinds
from carillon.fem.geometry.facets import connected


@dataclass(frozen=True)
class Faces:
    """Cells that meet across faces."""

    alike: Index
    """(m, 3) two cells of one size, the lower one first, and the axis across the face."""
    unlike: Index
    """(k, 4) a cell, one of half its edge, the axis, and on which side of that axis the latter's
    face is: 0 or 1."""

    def chosen(self, kept: Flags) -> Faces:
        """Those between cells that are kept, by their new numbers."""
        number = np.cumsum(kept) - 1
        faces = []
        for each in (self.alike, self.unlike):
            stays = each[kept[each[:, :2]].all(axis=1)]
            faces.append(np.column_stack([number[stays[:, :2]], stays[:, 2:]]))
        return Faces(*faces)

    @property
    def pairs(self) -> Index:
        """(m + k, 2) the cells that meet."""
        return np.concatenate([self.alike[:, :2], self.unlike[:, :2]])

    def pieces(self, count: int) -> Index:
        """Piece (count,) of the solid that each cell is of."""
        return connected(count, *self.pairs.T)


@dataclass(frozen=True)
class Joined:
    """Nodes of cells."""

    nodes: Index
    """(c, n) nodes of each cell."""
    places: Index
    """(k, 3) where the nodes are, in steps of the lattice, ordered by (z, y, x)."""
    kinds: NDArray[np.int32]
    """(c,) see `carillon.fem.finite_cells.hanging`."""


def joined_nodes(basis: Basis, corner: Index, span: Index, faces: Faces, slight: Flags) -> Joined:
    """Nodes of cells with these lowest corners (p, 3) and edges (p,), in steps of the lattice.

    Some are so `slight` (p,) that they are not among the c cells, but they hold others together.
    """
    octant = corner // span[:, None] % 2
    host, also = _hosts(corner, span, octant, faces, slight)
    hangs = host >= 0
    kinds = kinds_of_cells(octant @ np.array([1, 2, 4]), hangs)
    step = span // basis.degree
    count, own = len(basis.nodes), np.arange(len(corner) * len(basis.nodes))
    places = corner[:, None] + step[:, None, None] * places_of_kinds(basis.degree, kinds)
    number = own.reshape(len(corner), count).copy()
    joins = [*_take_from_hosts(basis, corner, step, octant, host, places, number)]
    joins += _of_several_hosts(basis, corner, step, also)
    joins += _across(basis, places, number, faces.alike)
    joins += _across_unlike(basis, corner, step, places, number, faces.unlike, hangs)
    label = connected(len(own), *np.concatenate(joins, axis=1))
    nodes = label[number[~slight]]
    return Joined(*_ordered(nodes, label[number], places), kinds[~slight])


def _hosts(
    corner: Index, span: Index, octant: Index, faces: Faces, slight: Flags
) -> tuple[Index, Index]:
    """Cells (p, 6) whose faces and edges each cell's outer ones are in; -1 where none.

    Also pairs (h, 2) of such cells that one cell has for the same face or edge.
    """
    host = np.full((len(corner), 6), -1)
    rows = faces.unlike[~slight[faces.unlike[:, 0]]]
    also = [np.empty((0, 2), dtype=np.int64)]

    def take(cell: Index, column: Index, larger: Index) -> bool:
        there = larger >= 0
        cell, column, larger = cell[there], column[there], larger[there]
        fresh = host[cell, column] < 0
        host[cell[fresh], column[fresh]] = larger[fresh]
        pairs = np.stack([host[cell, column], larger], axis=1)
        also.append(pairs[pairs[:, 0] != pairs[:, 1]])
        return bool(fresh.any())

    take(rows[:, 1], rows[:, 2], rows[:, 0])
    below, above, axis = faces.alike.T
    parent = corner // (2 * span[:, None])
    same = (parent[below] == parent[above]).all(axis=1)
    # What hangs on one side of a face does so on the other.
    while True:
        changed = False
        for one, other in ((below, above), (above, below)):
            for step in (1, 2):
                across = (axis + step) % 3
                third = (axis + 3 - step) % 3
                changed |= take(other[same], across[same], host[one[same], across[same]])
                apart = ~same
                changed |= take(other[apart], 3 + third[apart], host[one[apart], across[apart]])
                changed |= take(other[apart], 3 + third[apart], host[one[apart], 3 + third[apart]])
            changed |= take(other[same], 3 + axis[same], host[one[same], 3 + axis[same]])
        for face in range(3):
            for edge in range(3):
                if edge != face:
                    every = np.arange(len(host))
                    changed |= take(every, np.full(len(host), 3 + edge), host[:, face])
        if not changed:
            break
    pairs = np.unique(np.concatenate(also), axis=0)
    return host, pairs


def _slots_at(basis: Basis, places: Index) -> Index:
    """Nodes (p,) of a cell at places (p, 3) in steps of it; -1 where it has none."""
    size = basis.degree + 1
    table = np.full((size, size, size), -1)
    table[tuple(basis.nodes.T)] = np.arange(len(basis.nodes))
    inside = ((places >= 0) & (places < size)).all(axis=1)
    found = np.full(len(places), -1)
    found[inside] = table[tuple(places[inside].T)]
    return found


def _take_from_hosts(
    basis: Basis,
    corner: Index,
    step: Index,
    octant: Index,
    host: Index,
    places: Index,
    number: Index,
) -> list[Index]:
    """Put nodes of larger cells in the place of those (p, n) that hang; pairs that are one."""
    joins = []
    count = len(basis.nodes)
    own = number.copy()
    for column in range(6):
        cells = np.flatnonzero(host[:, column] >= 0)
        if not len(cells):
            continue
        at_end = basis.nodes[None] == basis.degree * octant[cells, None]
        across = [column] if column < 3 else [axis for axis in range(3) if axis != column - 3]
        row, slot = np.nonzero(at_end[:, :, across].all(axis=2))
        cell, larger = cells[row], host[cells[row], column]
        local, rest = np.divmod(places[cell, slot] - corner[larger], step[larger, None])
        target = _slots_at(basis, np.where(rest == 0, local, -1))
        if (target < 0).any():
            raise AssertionError("a node hangs where the larger cell has none")
        target = count * larger + target
        fresh = number[cell, slot] == own[cell, slot]
        joins.append(np.stack([number[cell, slot], target])[:, ~fresh])
        number[cell[fresh], slot[fresh]] = target[fresh]
    # What is in its own place may be a node of yet smaller cells.
    stays = places == corner[:, None] + step[:, None, None] * basis.nodes
    there = stays.all(axis=2) & (number != own)
    joins.append(np.stack([own[there], number[there]]))
    return joins


def _of_several_hosts(basis: Basis, corner: Index, step: Index, pairs: Index) -> list[Index]:
    """Nodes of two larger cells at the same places, which are one."""
    if not len(pairs):
        return []
    one, other = pairs.T
    places = corner[one, None] + step[one, None, None] * basis.nodes
    pair, slot = np.indices(places.shape[:2]).reshape(2, -1)
    local, rest = np.divmod(places[pair, slot] - corner[other[pair]], step[other[pair], None])
    target = _slots_at(basis, np.where(rest == 0, local, -1))
    there = target >= 0
    count = len(basis.nodes)
    return [np.stack([count * one[pair] + slot, count * other[pair] + target])[:, there]]


def _across(basis: Basis, places: Index, number: Index, faces: Index) -> list[Index]:
    joins = []
    for axis in range(3):
        below, above, _ = faces[faces[:, 2] == axis].T
        low, high = basis.faces[2 * axis], basis.faces[2 * axis + 1]
        one, other = number[below][:, high], number[above][:, low]
        same = (places[below][:, high] == places[above][:, low]).all(axis=2)
        joins.append(np.stack([one[same], other[same]]))
    return joins


def _across_unlike(
    basis: Basis,
    corner: Index,
    step: Index,
    places: Index,
    number: Index,
    faces: Index,
    hangs: Flags,
) -> list[Index]:
    """Nodes of small cells that do not hang from slight larger ones, but meet them."""
    joins = [np.empty((2, 0), dtype=np.int64)]
    count = len(basis.nodes)
    for axis in range(3):
        for side in range(2):
            chosen = faces[(faces[:, 2] == axis) & (faces[:, 3] == side)]
            chosen = chosen[~hangs[chosen[:, 1], axis]]
            larger, cell = chosen[:, 0, None], chosen[:, 1, None]
            slots = basis.faces[2 * axis + side][None]
            at = (places[cell, slots] - corner[larger]).reshape(-1, 3)
            each = np.broadcast_to(larger, number[cell, slots].shape).ravel()
            local, rest = np.divmod(at, step[each, None])
            target = _slots_at(basis, np.where(rest == 0, local, -1))
            there = target >= 0
            ends = number[cell, slots].ravel()[there]
            joins.append(np.stack([ends, count * each[there] + target[there]]))
    return joins


def _ordered(nodes: Index, label: Index, places: Index) -> tuple[Index, Index]:
    """Nodes numbered by place, and in one place by the cells that have them."""
    flat, at = label.ravel(), places.reshape(-1, 3)
    first = np.full(int(flat.max()) + 1, -1)
    first[flat[::-1]] = np.arange(len(flat))[::-1]
    used = np.unique(nodes)
    order = np.lexsort((first[used], *at[first[used]].T))
    rank = np.empty(len(first), dtype=np.int64)
    rank[used[order]] = np.arange(len(used))
    return rank[nodes], at[first[used]][order]


def joined_voxels(
    corner: Index, count: int, cell: Index, slot: Index, alike: Index
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Corners (e, 8) of voxels of cells, and places (k, 3) of these, ordered by (z, y, x).

    `corner` (p, 3) are the cells' lowest voxels, of which they have `count` along an edge; voxels
    (e,) are the `slot`-th of a `cell`. See `Faces` for those that meet.
    """
    size = count + 1
    points = voxel_places(size)
    stride = np.array([1, size, size**2])
    joins = [np.empty((2, 0), dtype=np.int64)]
    for axis in range(3):
        below, above, _ = alike[alike[:, 2] == axis].T
        low = np.flatnonzero(points[:, axis] == 0)
        high = low + count * stride[axis]
        ends = below[:, None] * size**3 + high, above[:, None] * size**3 + low
        joins.append(np.stack([ends[0].ravel(), ends[1].ravel()]))
    label = connected(size**3 * len(corner), *np.concatenate(joins, axis=1))
    offsets = voxel_places(count)[slot][:, None] + voxel_places(2)
    own = cell[:, None] * size**3 + offsets @ stride
    at = np.empty((int(label.max()) + 1, 3), dtype=np.int64)
    first = np.full(len(at), -1)
    first[label[::-1]] = np.arange(len(label))[::-1]
    at[:] = corner[first // size**3] + points[first % size**3]
    used = np.unique(label[own])
    order = np.lexsort((first[used], *at[used].T))
    rank = np.empty(len(at), dtype=np.int64)
    rank[used[order]] = np.arange(len(used))
    return rank[label[own]].astype(np.int32), at[used[order]].astype(np.int32)
