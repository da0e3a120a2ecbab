"""Pieces of the lattice's lines that are inside a surface, and states of its voxels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array, Index
from carillon.fem.finite_cells.lines import Lines

EMPTY, CUT, FULL, SKIPPED = 0, 1, 2, 3
"""States of a voxel; skipped are those that nobody asked for."""
TOUCHING = 1e-9
"""Gap [voxels] between two pieces that are one."""


@dataclass(frozen=True)
class Pieces(Lines):
    """Pieces of the lines along one axis that are inside.

    Attributes
    ----------
    low, high : (k,)
        Their ends in lattice units, ascending on each line.
    """

    low: Array
    high: Array


def joined(lines: Lines, line: Index, low: Array, high: Array) -> Pieces:
    """Pieces of which those that follow each other without a gap are one."""
    follows = np.zeros(len(line), dtype=bool)
    follows[1:] = (line[1:] == line[:-1]) & (low[1:] - high[:-1] <= TOUCHING)
    first = np.flatnonzero(~follows)
    last = np.append(first, len(line))[1:] - 1
    start = np.searchsorted(line[first], np.arange(len(lines.start)))
    return Pieces(lines.axis, lines.across, start, low[first], high[last])


def points_on(lines: Lines, line: Index, place: Array) -> Array:
    """Points (..., p, 3) in lattice units at places (..., p) on lines (p,)."""
    row, column = np.divmod(line, lines.columns)
    points = np.empty((*place.shape, 3))
    points[..., lines.axis] = place
    for more, number in enumerate((row, column)):
        points[..., (lines.axis + 1 + more) % 3] = lines.across[more].coordinates[number]
    return points
