"""Parts of the cells of a lattice that the inside of a surface falls into."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index, Surface
from carillon.fem.finite_cells.inside import Inside, find_inside
from carillon.fem.finite_cells.lines import EMPTY, FULL, SKIPPED
from carillon.fem.finite_cells.parts import Labels, find_parts, meetings, meetings_of_halves
from carillon.fem.finite_cells.shapes import octant_weights
from carillon.fem.finite_cells.weights import weights_of_parts
from carillon.fem.geometry.grid import Grid

SMALLEST_OCTANT = 1e-6
"""Share of a voxel below which it counts as empty."""
FEWEST_LINES = 24
"""Pieces of lines, of the 256 across a cell, that it takes to be one, see `absorbing`."""


@dataclass(frozen=True)
class LatticeCover:
    """Cells of one lattice that hold anything, and their parts that touch nowhere in them."""

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
    row: Index
    weights: Array
    """See `carillon.fem.finite_cells.cells.FiniteCells`."""
    met: Index
    """(m, 3) parts that meet, the lower one first, and the axis across their face."""
    slight: Flags
    """(p,) parts that are no cells of their own, see `carillon.fem.finite_cells.absorbing`."""

    def __len__(self) -> int:
        return len(self.row)

    @property
    def grid(self) -> Index:
        """Lowest voxel (p, 3) of each part's cell."""
        return self.places[self.owner]

    @property
    def volumes(self) -> Array:
        """Volume (p,) of each part [voxels]."""
        return np.asarray(8.0 * self.weights.sum(axis=(1, 2))[self.row])

    def cells_at(self, places: Index) -> Index:
        """Cells (n,) at places (n, 3); -1 where there is none."""
        low = np.minimum(self.places.min(axis=0), places.min(axis=0, initial=0))
        shape = np.maximum(self.places.max(axis=0), places.max(axis=0, initial=0)) - low + 1
        keys = np.ravel_multi_index(tuple((self.places - low).T), tuple(shape))
        asked = np.ravel_multi_index(tuple((places - low).T), tuple(shape))
        order = np.argsort(keys)
        at = order[np.minimum(np.searchsorted(keys[order], asked), len(keys) - 1)]
        return np.where(keys[at] == asked, at, -1)

    def numbered(self, cells: Index, labels: Index) -> Index:
        """Parts (n,) with these labels, from 1, in cells (n,); -1 for those that hold nothing."""
        return np.asarray(self.number[self.first[cells] + labels - 1])


def cover_of(inside: Inside) -> LatticeCover:
    """The cells of a lattice that hold any of the inside."""
    state, facing = _by_cell(inside.state), _by_cell(inside.facing)
    there = ((state != EMPTY) & (state != SKIPPED)).any(axis=3)
    numbers = np.full(state.shape[:3], -1, dtype=np.int64)
    numbers[there] = np.arange(np.count_nonzero(there))
    places = 2 * np.argwhere(there)[:, ::-1]
    whole = (state[there] == FULL).all(axis=1)
    cut = np.flatnonzero(~whole)
    state, facing, corners = state[there][cut], facing[there][cut], places[cut]
    labels, counts = find_parts(corners, state, inside.pieces)
    first = np.cumsum(counts) - counts
    weights, lines = weights_of_parts(
        corners, state, facing, inside.pieces, labels, first, int(counts.sum())
    )
    weights[weights.sum(axis=2) < SMALLEST_OCTANT / 8.0] = 0.0
    parts = np.ones(len(places), dtype=np.int64)
    parts[cut] = counts
    owner = np.repeat(np.arange(len(places)), parts)
    row = np.zeros(len(owner), dtype=np.int64)
    # Faces in planes of the lattice touch cells that they do not cut.
    is_cut = np.abs(weights - octant_weights()).max(axis=(1, 2)) > SMALLEST_OCTANT
    row[~whole[owner]] = np.where(is_cut, 1 + np.arange(len(weights)), 0)
    table = np.concatenate([octant_weights()[None], weights])
    holds = table.any(axis=(1, 2))[row]
    slight = np.zeros(len(owner), dtype=bool)
    slight[~whole[owner]] = lines < FEWEST_LINES
    among_cut = np.full(len(places), -1)
    among_cut[cut] = np.arange(len(cut))
    cover = LatticeCover(
        places,
        among_cut,
        labels,
        np.cumsum(parts) - parts,
        np.where(holds, np.cumsum(holds) - 1, -1),
        owner[holds],
        row[holds],
        table,
        np.empty((0, 3), dtype=np.int64),
        slight[holds],
    )
    return _with_meetings(cover, numbers)


def _with_meetings(cover: LatticeCover, numbers: Index) -> LatticeCover:
    met = []
    for axis in range(3):
        lower, upper = _neighbours(numbers, axis)
        pair, below, above = meetings(cover.cut[lower], cover.cut[upper], cover.labels, axis).T
        below, above = cover.numbered(lower[pair], below), cover.numbered(upper[pair], above)
        rows = np.stack([below, above, np.full(len(pair), axis)], axis=1)
        met.append(rows[(rows >= 0).all(axis=1)])
    return replace(cover, met=np.concatenate(met))


def divided_cover(surface: Surface, grid: Grid, places: Index) -> LatticeCover:
    """Cover by cells of half the edge where those of a lattice at `places` (d, 3) are divided.

    Its places are in voxels of half the edge, from the same origin.
    """
    low, high = places.min(axis=0), places.max(axis=0) + 2
    shape = 2 * (high - low)
    box = Grid(
        grid.origin + grid.edge * low,
        grid.edge / 2.0,
        (int(shape[0]), int(shape[1]), int(shape[2])),
    )
    divided = np.zeros(tuple(shape // 4), dtype=bool)
    divided[tuple(((places - low) // 2).T)] = True
    requested = divided.repeat(4, axis=0).repeat(4, axis=1).repeat(4, axis=2)
    cover = cover_of(find_inside(surface, box, requested))
    return replace(cover, places=cover.places + 2 * low)


def faces_of_halves(whole: LatticeCover, half: LatticeCover, undivided: Flags) -> Index:
    """Parts of undivided cells (c,) and of cells of half the edge that meet: rows (k, 4).

    They are as in `carillon.fem.finite_cells.joining.Faces`.
    """
    rows = [np.empty((0, 4), dtype=np.int64)]
    for axis in range(3):
        across = [other for other in range(3) if other != axis]
        for side in (0, 2):
            there = np.flatnonzero(half.places[:, axis] % 4 == side)
            beside = half.places[there] // 4 * 2
            beside[:, axis] += 2 if side else -2
            neighbour = whole.cells_at(beside)
            meets = neighbour >= 0
            meets[meets] = undivided[neighbour[meets]]
            there, neighbour = there[meets], neighbour[meets]
            quarter = half.places[there][:, across] // 2 % 2
            pair, one, other_part = meetings_of_halves(
                whole.cut[neighbour],
                half.cut[there],
                quarter,
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


def _by_cell(values: NDArray[np.int8]) -> NDArray[np.int8]:
    """Values (nz / 2, ny / 2, nx / 2, 8) of the octants of each cell, in bit order."""
    nx, ny, nz = (size // 2 for size in values.shape)
    octants = values.reshape(nx, 2, ny, 2, nz, 2).transpose(4, 2, 0, 5, 3, 1)
    return np.ascontiguousarray(octants.reshape(nz, ny, nx, 8))


def _neighbours(number: Index, axis: int) -> tuple[Index, Index]:
    """Numbers of cells that follow each other along an axis, of an array in (z, y, x)."""
    turned = np.moveaxis(number, 2 - axis, 0)
    lower, upper = turned[:-1].ravel(), turned[1:].ravel()
    both = (lower >= 0) & (upper >= 0)
    return lower[both], upper[both]
