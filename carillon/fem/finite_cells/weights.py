"""Weights of the cells' points: integrals of their Lagrange polynomials over the inside."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.fem.finite_cells.inside import CUT, FULL, Pieces
from carillon.fem.finite_cells.lines import BOUNDS, LINE_PLACES, LINE_SHARES, LINES
from carillon.fem.finite_cells.parts import Labels
from carillon.fem.finite_cells.shapes import (
    OCTANTS,
    POINT_PLACES,
    POINTS,
    lagrange,
    octant_weights,
)

Array = NDArray[np.float64]
Index = NDArray[np.int64]


def weights_of_parts(
    cells: Index,
    state: NDArray[np.int8],
    facing: NDArray[np.int8],
    pieces: tuple[Pieces, ...],
    labels: Labels,
    first: Index,
    count: int,
) -> Array:
    """Weights (count, 8, 125) of the points for the inside of each octant of each part.

    An octant is integrated along the axis that the surface faces there.

    Parameters
    ----------
    cells : (k, 3)
        Lowest voxels of the cells.
    state, facing : (k, 8)
        Of their octants, see `carillon.fem.finite_cells.inside`.
    pieces
        Of the lines along x, y and z.
    labels
        See `carillon.fem.finite_cells.parts.find_parts`.
    first : (k,)
        Number of each cell's first part.
    """
    weights = np.zeros((count, OCTANTS, POINTS))
    halves = (np.arange(2)[:, None] / 2.0 + LINE_PLACES / 2.0).ravel()
    across = lagrange(POINT_PLACES, halves).reshape(2, LINES, -1)
    for each in pieces:
        chosen = (state == CUT) & (facing == each.axis)
        _integrate(
            cells,
            chosen,
            each.axis,
            labels,
            first,
            (each.start, each.low, each.high, each.columns),
            across,
            LINE_SHARES,
            BOUNDS,
            POINT_PLACES,
            weights,
        )
    cell, octant = np.nonzero(state == FULL)
    corner = LINES * np.stack([octant & 1, octant >> 1 & 1, octant >> 2], axis=1)
    part = labels[cell, corner[:, 0], corner[:, 1], corner[:, 2]].astype(np.int64)
    weights[first[cell] + part - 1, octant] = octant_weights()[octant]
    return weights


@numba.njit(cache=True, nogil=True)
def _integrate(  # type: ignore[no-untyped-def]
    cells, chosen, axis, labels, first, pieces, across, shares, bounds, points, weights
):
    start, low, high, columns = pieces
    n = len(shares)
    b, c = (axis + 1) % 3, (axis + 2) % 3
    stride = np.array([1, 5, 25])
    along, at = np.empty(5), np.empty(3, dtype=np.int64)
    for k in range(len(cells)):
        for octant in range(8):
            if not chosen[k, octant]:
                continue
            half_a, half_b, half_c = octant >> axis & 1, octant >> b & 1, octant >> c & 1
            voxel = cells[k, axis] + half_a
            for i in range(n):
                for j in range(n):
                    row, column = (cells[k, b] + half_b) * n + i, (cells[k, c] + half_c) * n + j
                    line = row * columns + column
                    area = 0.25 * shares[i] * shares[j]
                    at[b], at[c] = half_b * n + i, half_c * n + j
                    for number in range(start[line], start[line + 1]):
                        begin = max(low[number] - voxel, 0.0)
                        end = min(high[number] - voxel, 1.0)
                        if end <= begin:
                            continue
                        box = 0
                        while box < n - 1 and bounds[box] <= 0.5 * (begin + end):
                            box += 1
                        at[axis] = half_a * n + box
                        part = labels[k, at[0], at[1], at[2]]
                        if part == 0:
                            continue
                        _along(0.5 * (half_a + begin), 0.5 * (half_a + end), points, along)
                        to = weights[first[k] + part - 1, octant]
                        for mb in range(5):
                            for mc in range(5):
                                factor = area * across[half_b, i, mb] * across[half_c, j, mc]
                                place = stride[b] * mb + stride[c] * mc
                                for ma in range(5):
                                    to[place + stride[axis] * ma] += factor * along[ma]


@numba.njit(cache=True, nogil=True)
def _along(begin, end, points, result):  # type: ignore[no-untyped-def]
    """Integrals of the Lagrange polynomials of the points, by three Gauss points."""
    reach = np.sqrt(0.15) * (end - begin)
    result[:] = 0.0
    for g in range(3):
        at = 0.5 * (begin + end) + (g - 1) * reach
        share = (end - begin) * (8.0 if g == 1 else 5.0) / 18.0
        for m in range(5):
            value = share
            for other in range(5):
                if other != m:
                    value *= (at - points[other]) / (points[m] - points[other])
            result[m] += value
