"""Parts of the cells of a lattice that the inside of a surface falls into."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index, Surface
from carillon.errors import UserError
from carillon.fem.finite_cells.basis import Basis
from carillon.fem.finite_cells.inside import Inside, find_inside, shares_of_axes
from carillon.fem.finite_cells.lines import EMPTY, FULL, SKIPPED
from carillon.fem.finite_cells.parts import Labels, find_parts, meetings, meetings_of_halves
from carillon.fem.finite_cells.weights import Portions, portions_of_parts
from carillon.fem.geometry.grid import Grid
from carillon.fem.geometry.walls import Wall

SMALLEST_PORTION = 1e-6
"""Share of a voxel below which it counts as empty."""
FEWEST_LINES = 0.1
"""Pieces of lines, of those across a voxel, that it takes to be a cell, see `absorbing`."""
LARGEST_LATTICE = 1e8
"""Voxels of the box about all cells that are divided, at most."""
FEWEST_VOXELS = 2
"""Least number of voxels of lines along the edge of a cell, however often it is divided."""


def voxels_along(degree: int, level: int) -> int:
    """Voxels of lines along the edge of a cell of this degree that is divided `level` times."""
    return max(degree >> level, FEWEST_VOXELS)


@dataclass(frozen=True)
class LatticeCover:
    """Cells of one lattice that hold anything, and their parts that touch nowhere in them."""

    level: int
    """How many times its cells are divided."""
    count: int
    """Voxels of the lattice along the edge of a cell."""
    places: Index
    """(c, 3) lowest voxel of each cell."""
    cut: Index
    """(c,) row of `labels` of each cell; -1 if it is all inside."""
    labels: Labels
    """(k, boxes, boxes, boxes) part of each box, see `carillon.fem.finite_cells.parts`."""
    first: Index
    """(c,) number of each cell's first part, before those that hold nothing are left out."""
    number: Index
    """(q,) number of each such part among those that are left, -1 of the others."""
    owner: Index
    """(p,) cell of each part."""
    part: Index
    voxel: Index
    row: Index
    """(e,) the part, voxel of its cell and row of `weights` of what parts have of voxels."""
    weights: Array
    """(k, q^3) of the points of lines, see `Portions`; first those of the whole voxels."""
    met: Index
    """(m, 3) parts that meet, the lower one first, and the axis across their face."""
    slight: Flags
    """(p,) parts that are no cells of their own, see `carillon.fem.finite_cells.absorbing`."""

    def __len__(self) -> int:
        return len(self.owner)

    @property
    def corner(self) -> Index:
        """Lowest voxel (p, 3) of each part's cell."""
        return self.places[self.owner]

    @property
    def volumes(self) -> Array:
        """Share (p,) of its cell that each part has."""
        shares = self.weights.sum(axis=1)[self.row]
        return np.bincount(self.part, shares, minlength=len(self)).astype(np.float64)

    def cells_at(self, places: Index) -> Index:
        """Cells (n,) at places (n, 3); -1 where there is none."""
        shape = tuple(np.concatenate([self.places, places]).max(axis=0, initial=0) + 1)
        keys = np.ravel_multi_index(tuple(self.places.T), shape)
        order = np.argsort(keys)
        inside = (places >= 0).all(axis=1)
        requested = np.full(len(places), -1)
        requested[inside] = np.ravel_multi_index(tuple(places[inside].T), shape)
        at = np.minimum(np.searchsorted(keys[order], requested), max(len(keys) - 1, 0))
        found = order[at] if len(keys) else np.full(len(places), -1)
        is_there = keys[found] == requested if len(keys) else np.zeros(len(places), dtype=bool)
        return np.where(is_there, found, -1)

    def numbered(self, cells: Index, labels: Index) -> Index:
        """Parts (n,) with these labels, from 1, in cells (n,); -1 for those that hold nothing."""
        return np.asarray(self.number[self.first[cells] + labels - 1])

    @property
    def label(self) -> Index:
        """Label (p,) of each part in its cell, from 1."""
        number = np.flatnonzero(self.number >= 0)
        return np.asarray(number - self.first[self.owner] + 1)


def cover_of(inside: Inside, basis: Basis, level: int = 0) -> LatticeCover:
    """The cells that hold any of the inside, of a lattice of cells divided `level` times."""
    count = voxels_along(basis.degree, level)
    state = _by_cell(inside.state, count)
    crossed = np.stack([_by_cell(inside.crossed[..., axis], count) for axis in range(3)], axis=-1)
    there = ((state != EMPTY) & (state != SKIPPED)).any(axis=3)
    numbers = np.full(state.shape[:3], -1, dtype=np.int64)
    numbers[there] = np.arange(np.count_nonzero(there))
    places = count * np.argwhere(there)[:, ::-1]
    whole = (state[there] == FULL).all(axis=1)
    cut = np.flatnonzero(~whole)
    state, corners = state[there][cut], places[cut]
    facing = shares_of_axes(crossed[there][cut])
    labels, counts = find_parts(corners, count, state, inside.pieces)
    first = np.cumsum(counts) - counts
    of_cells = corners, count, state, facing, inside.pieces, labels, first
    found = portions_of_parts(basis, *of_cells, int(counts.sum()))
    parts = np.ones(len(places), dtype=np.int64)
    parts[cut] = counts
    owner = np.repeat(np.arange(len(places)), parts)
    among_all = np.flatnonzero(~whole[owner])
    full_parts = np.flatnonzero(whole[owner])
    part, voxel, row, weights = _table(basis, count, found, among_all, full_parts)
    holds = np.zeros(len(owner), dtype=bool)
    holds[part] = True
    slight = np.zeros(len(owner), dtype=bool)
    slight[among_all] = found.lines < FEWEST_LINES
    among_cut = np.full(len(places), -1)
    among_cut[cut] = np.arange(len(cut))
    number = np.where(holds, np.cumsum(holds) - 1, -1)
    cover = LatticeCover(
        level,
        count,
        places,
        among_cut,
        labels,
        np.cumsum(parts) - parts,
        number,
        owner[holds],
        number[part],
        voxel,
        row,
        weights,
        np.empty((0, 3), dtype=np.int64),
        slight[holds],
    )
    return _with_meetings(cover, numbers)


def _table(
    basis: Basis, count: int, found: Portions, among_all: Index, full_parts: Index
) -> tuple[Index, Index, Index, Array]:
    """Arrays `part`, `voxel`, `row` and `weights` of `LatticeCover`: a row a voxel in a part."""
    whole = basis.line_voxels(count)
    kept = found.weights.sum(axis=1) >= SMALLEST_PORTION / count**3
    part, voxel, weights = among_all[found.part[kept]], found.voxel[kept], found.weights[kept]
    # Faces in planes of the lattice touch voxels that they do not cut.
    is_cut = np.abs(weights - whole[voxel]).max(axis=1) > SMALLEST_PORTION / count**3
    row = np.where(is_cut, len(whole) + np.cumsum(is_cut) - 1, voxel)
    every = np.tile(np.arange(count**3), len(full_parts))
    part = np.concatenate([part, np.repeat(full_parts, count**3)])
    voxel, row = np.concatenate([voxel, every]), np.concatenate([row, every])
    order = np.lexsort((voxel, part))
    return part[order], voxel[order], row[order], np.concatenate([whole, weights[is_cut]])


def _with_meetings(cover: LatticeCover, numbers: Index) -> LatticeCover:
    met = []
    for axis in range(3):
        lower, upper = _neighbours(numbers, axis)
        pair, below, above = meetings(cover.cut[lower], cover.cut[upper], cover.labels, axis).T
        below, above = cover.numbered(lower[pair], below), cover.numbered(upper[pair], above)
        rows = np.stack([below, above, np.full(len(pair), axis)], axis=1)
        met.append(rows[(rows >= 0).all(axis=1)])
    return replace(cover, met=np.concatenate(met))


def divided_cover(
    surface: Surface | Wall, grid: Grid, places: Index, level: int, basis: Basis
) -> LatticeCover:
    """Cover by cells divided `level` times, where those divided once less, at `places`, are.

    `places` (d, 3) are in edges of these cells, from the lattice's origin. Those of the cover are
    in voxels of half the edge of its own cells, from there, too.
    """
    count = voxels_along(basis.degree, level)
    edge = basis.degree * grid.edge / 2**level / count
    per_cell = 2 * count
    low, high = places.min(axis=0), places.max(axis=0) + 1
    shape = per_cell * (high - low)
    box = Grid(
        grid.origin + edge * per_cell * low,
        edge,
        (int(shape[0]), int(shape[1]), int(shape[2])),
    )
    if np.prod(shape.astype(float)) > LARGEST_LATTICE:
        raise UserError(
            f"cells divided {level} times need a lattice of {np.prod(shape.astype(float)):.2g} "
            f"voxels, the limit is {LARGEST_LATTICE:.2g}; lower the resolution"
        )
    divided = np.zeros(tuple(high - low), dtype=bool)
    divided[tuple((places - low).T)] = True
    requested = divided
    for axis in range(3):
        requested = requested.repeat(per_cell, axis=axis)
    cover = cover_of(find_inside(surface, box, requested), basis, level)
    return replace(cover, places=cover.places + per_cell * low)


def faces_of_halves(whole: LatticeCover, half: LatticeCover, undivided: Flags) -> Index:
    """Parts of undivided cells (c,) and of cells of half the edge that meet: rows (k, 4).

    They are as in `carillon.fem.finite_cells.joining.Faces`.
    """
    rows = [np.empty((0, 4), dtype=np.int64)]
    cell = half.places // half.count
    for axis in range(3):
        across = [other for other in range(3) if other != axis]
        for side in (0, 1):
            there = np.flatnonzero(cell[:, axis] % 2 == side)
            beside = cell[there] // 2
            beside[:, axis] += 1 if side else -1
            neighbour = whole.cells_at(whole.count * beside)
            meets = neighbour >= 0
            meets[meets] = undivided[neighbour[meets]]
            there, neighbour = there[meets], neighbour[meets]
            pair, one, other_part = meetings_of_halves(
                whole.cut[neighbour],
                half.cut[there],
                cell[there][:, across] % 2,
                (whole.labels, half.labels),
                axis,
                side,
            ).T
            one = whole.numbered(neighbour[pair], one)
            other_part = half.numbered(there[pair], other_part)
            ends = np.full(len(pair), axis), np.full(len(pair), side)
            rows.append(np.stack([one, other_part, *ends], axis=1))
    faces = np.concatenate(rows)
    return faces[(faces[:, :2] >= 0).all(axis=1)]


def _by_cell(values: NDArray[Any], count: int) -> NDArray[Any]:
    """Values (nz / count, ny / count, nx / count, count^3) of the voxels of each cell."""
    nx, ny, nz = (size // count for size in values.shape)
    voxels = values.reshape(nx, count, ny, count, nz, count).transpose(4, 2, 0, 5, 3, 1)
    return np.ascontiguousarray(voxels.reshape(nz, ny, nx, count**3))


def _neighbours(number: Index, axis: int) -> tuple[Index, Index]:
    """Numbers of cells that follow each other along an axis, of an array in (z, y, x)."""
    turned = np.moveaxis(number, 2 - axis, 0)
    lower, upper = turned[:-1].ravel(), turned[1:].ravel()
    both = (lower >= 0) & (upper >= 0)
    return lower[both], upper[both]
