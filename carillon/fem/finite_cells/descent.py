"""Which undivided cell, and which of its voxels, a cell of half the edge is part of."""

from __future__ import annotations

import numpy as np

from carillon.arrays import Flags, Index
from carillon.fem.element import CORNERS
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.cover import LatticeCover


def parents(whole: LatticeCover, half: LatticeCover, kept: Flags) -> Index:
    """Part (p,) of `whole` that each part of `half` lies in: of those kept, that with most in it.

    Where none has anything there it is the first that is kept in the place, or the first of all.
    """
    cells = whole.cells_at(half.grid // 4 * 2)
    last = np.append(whole.first[1:], len(whole.number))
    first_kept = int(np.flatnonzero(kept)[0])
    found = np.empty(len(half), dtype=np.int64)
    label = _labels(half)
    for part, cell in enumerate(cells):
        numbers = whole.number[whole.first[cell] : last[cell]]
        there = np.flatnonzero((numbers >= 0) & kept[numbers])
        if len(there) <= 1:
            found[part] = numbers[there[0]] if len(there) else first_kept
            continue
        shares = _shared_boxes(whole, half, part, int(cell), int(label[part]))
        found[part] = numbers[there[shares[there + 1].argmax()]]
    return found


def _labels(cover: LatticeCover) -> Index:
    number = np.flatnonzero(cover.number >= 0)
    return number - cover.first[cover.owner] + 1


def _shared_boxes(
    whole: LatticeCover, half: LatticeCover, part: int, cell: int, label: int
) -> Index:
    """Boxes that a part of a small cell shares with those of a whole one, by their labels."""
    size = whole.labels.shape[1]
    low = size // 2 * (half.grid[part] // 2 % 2)
    x, y, z = (slice(start, start + size // 2) for start in low)
    coarse = whole.labels[whole.cut[cell], x, y, z]
    fine = coarse.repeat(2, axis=0).repeat(2, axis=1).repeat(2, axis=2)
    row = half.cut[half.owner[part]]
    there = np.ones(fine.shape, dtype=bool) if row < 0 else half.labels[row] == label
    return np.bincount(fine[there], minlength=int(whole.labels.max(initial=0)) + 1)


def voxels_of_parents(cells: FiniteCells, undivided: FiniteCells, parent: Index) -> Index:
    """Voxel (m,) of the undivided mesh that each voxel of cells with a `parent` (c,) lies in.

    Where that is empty it is the nearest one of the parent.
    """
    cell, own = np.nonzero(cells.voxels >= 0)
    is_half = (cells.span == 2) & (cells.mesh.edge < undivided.mesh.edge)
    place = (cells.grid // 2 % 2) @ np.array([1, 2, 4])
    octant = np.where(is_half[cell], place[cell], own)
    far = np.abs(CORNERS[:, None] - CORNERS).sum(axis=2)[octant]
    candidates = undivided.voxels[parent[cell]]
    nearest = np.where(candidates >= 0, far, far.max() + 1).argmin(axis=1)
    found = np.empty(cells.mesh.n_cells, dtype=np.int64)
    found[cells.voxels[cell, own]] = candidates[np.arange(len(cell)), nearest]
    return found
