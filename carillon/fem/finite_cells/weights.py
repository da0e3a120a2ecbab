"""Weights of the cells' points: integrals of their Lagrange polynomials over the inside."""

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Index
from carillon.fem.element import CORNERS
from carillon.fem.finite_cells.lines import CUT, FULL, LINES, Pieces, Spread
from carillon.fem.finite_cells.parts import Labels, box_bounds
from carillon.fem.finite_cells.shapes import OCTANTS, POINT_PLACES, POINTS, lagrange, octant_weights


def weights_of_parts(
    cells: Index,
    state: NDArray[np.int8],
    facing: NDArray[np.int8],
    pieces: tuple[Pieces, ...],
    labels: Labels,
    first: Index,
    count: int,
) -> tuple[Array, Index]:
    """Weights (count, 8, 125) of the points for the inside of each octant of each part.

    With them comes on how many pieces of lines (count,) those of a part rest.

    An octant is integrated along the axis that the surface faces there. `cells` (k, 3), `state`
    (k, 8), `pieces` and `labels` are as in `carillon.fem.finite_cells.parts.find_parts`, `facing`
    (k, 8) as in `carillon.fem.finite_cells.inside.Inside`; `first` (k,) is each cell's first part.
    """
    weights, lines = np.zeros((count, OCTANTS, POINTS)), np.zeros(count, dtype=np.int64)
    for each, bounds in zip(pieces, box_bounds(pieces)):
        chosen = (state == CUT) & (facing == each.axis)
        of_cells = cells, chosen, each.axis, labels, first
        along = each.start, each.low, each.high, each.columns
        rows, columns = map(_across, each.across)
        _integrate(*of_cells, along, rows, columns, bounds, POINT_PLACES, weights, lines)
    cell, octant = np.nonzero(state == FULL)
    part = labels[cell, *(LINES * CORNERS[octant]).T].astype(np.int64)
    weights[first[cell] + part - 1, octant] = octant_weights()[octant]
    np.add.at(lines, first[cell] + part - 1, LINES**2)
    return weights, lines


def _across(spread: Spread) -> Array:
    """Lagrange polynomials (n, LINES, 5) at the lines in their cells, times half their shares."""
    voxel = np.arange(len(spread.places))
    places = (voxel[:, None] % 2 + spread.places) / 2.0
    values = lagrange(POINT_PLACES, places.ravel()).reshape(*places.shape, -1)
    return 0.5 * spread.shares[:, :, None] * values


@numba.njit(cache=True, nogil=True)
def _integrate(  # type: ignore[no-untyped-def]
    cells, chosen, axis, labels, first, pieces, lines_b, lines_c, bounds, points, weights, lines
):
    start, low, high, columns = pieces
    n = lines_b.shape[1]
    b, c = (axis + 1) % 3, (axis + 2) % 3
    stride = np.array([1, 5, 25])
    along, at = np.empty(5), np.empty(3, dtype=np.int64)
    for k in range(len(cells)):
        for octant in range(8):
            if not chosen[k, octant]:
                continue
            half_a, half_b, half_c = octant >> axis & 1, octant >> b & 1, octant >> c & 1
            voxel = cells[k, axis] + half_a
            voxel_b, voxel_c = cells[k, b] + half_b, cells[k, c] + half_c
            for i in range(n):
                for j in range(n):
                    line = (voxel_b * n + i) * columns + voxel_c * n + j
                    at[b], at[c] = half_b * n + i, half_c * n + j
                    for number in range(start[line], start[line + 1]):
                        begin = max(low[number] - voxel, 0.0)
                        end = min(high[number] - voxel, 1.0)
                        if end <= begin:
                            continue
                        box = 0
                        while box < n - 1 and bounds[voxel, box] <= 0.5 * (begin + end):
                            box += 1
                        at[axis] = half_a * n + box
                        part = labels[k, at[0], at[1], at[2]]
                        if part == 0:
                            continue
                        _along(0.5 * (half_a + begin), 0.5 * (half_a + end), points, along)
                        lines[first[k] + part - 1] += 1
                        to = weights[first[k] + part - 1, octant]
                        for mb in range(5):
                            for mc in range(5):
                                factor = lines_b[voxel_b, i, mb] * lines_c[voxel_c, j, mc]
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
