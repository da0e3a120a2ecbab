"""Groups of voxels that are of one material: cubes of a least edge, or the regions of a project."""

from __future__ import annotations

import numpy as np

from carillon.arrays import Array, Index, Integers
from carillon.errors import UserError
from carillon.fem.geometry.size import length_in_words

MOSTLY = 0.5
"""Share of the most voxels of a group up to which the surface has left so little of a cube that it
joins a neighbour."""


def cubes(grid: Integers, width: int) -> Index:
    """Numbers (M,) of the cubes of `width` voxels that voxels at `grid` (M, 3) are in.

    Cubes that the surface leaves half of or less join the neighbour that they share most faces
    of voxels with, so that no group is much thinner than others.

    Examples
    --------
    >>> row = np.array([[x, 0, 0] for x in range(5)])
    >>> cubes(row, 1).tolist(), cubes(row, 2).tolist()
    ([0, 1, 2, 3, 4], [0, 0, 1, 1, 1])
    """
    low = grid.min(axis=0)
    _, numbers = np.unique((grid - low) // width, axis=0, return_inverse=True)
    numbers = numbers.ravel()
    if width == 1:
        return np.asarray(numbers, dtype=np.int64)
    sides = _faces(grid)
    most = int(np.bincount(numbers).max())
    while True:
        counts = np.bincount(numbers)
        small = np.flatnonzero((counts > 0) & (counts <= MOSTLY * most))
        joined = False
        for group in small[np.argsort(counts[small], kind="stable")]:
            own = (numbers[sides] == group).sum(axis=1) == 1
            others = numbers[sides[own]].sum(axis=1) - group
            if len(others):
                numbers[numbers == group] = np.bincount(others).argmax()
                joined = True
                break
        if not joined:
            return np.asarray(np.unique(numbers, return_inverse=True)[1].ravel(), dtype=np.int64)


def width_of(at_least: float | None, edge: float, grid: Integers) -> int:
    """Voxels of `edge` [m] along the edge of cubes that are `at_least` [m] wide; 1 if None.

    Raises UserError if the solid is thinner than that along an axis.
    """
    if at_least is None:
        return 1
    width = max(1, int(np.ceil(at_least / edge * (1.0 - 1e-9))))
    thinnest = int((np.ptp(grid, axis=0) + 1).min())
    if width > thinnest:
        raise UserError(
            f"build.at_least: found {length_in_words(at_least)}, expected no more than "
            f"{length_in_words(thinnest * edge)}, which the solid is thick once it has its pitch; "
            "thinner parts, or a larger solid"
        )
    return width


def _faces(grid: Integers) -> Index:
    """Pairs (f, 2) of voxels that share a face."""
    shape = np.ptp(grid, axis=0) + 3
    places = np.full(shape, -1)
    at = tuple((grid - grid.min(axis=0) + 1).T)
    places[at] = np.arange(len(grid))
    pairs: list[Array] = []
    for axis in range(3):
        ahead = np.roll(places, -1, axis=axis)[at]
        there = np.flatnonzero(ahead >= 0)
        pairs.append(np.stack([there, ahead[there]], axis=1))
    return np.concatenate(pairs)
