"""Weights of the cells' points: integrals of their Lagrange polynomials over the inside."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Index
from carillon.fem.finite_cells.basis import Basis, lagrange, voxel_places
from carillon.fem.finite_cells.lines import CUT, FULL, Pieces, Spread
from carillon.fem.finite_cells.parts import BOXES, Labels, box_bounds

AT_ONCE = 4096
"""Voxels whose weights at all products of lines are held at once: 24 MB."""


@dataclass(frozen=True, eq=False)
class Portions:
    """Shares that parts of cells have in voxels, ordered by part and voxel."""

    part: Index
    voxel: Index
    """(e,), (e,) part, and number of the voxel in its cell, x fastest."""
    weights: Array
    """(e, q^3) of the points of lines, for a cell of volume one, see `Basis.line_points`."""
    lines: Array
    """(p,) pieces of lines that those of a part rest on, each by its share of the voxel, over how
    many there are across one."""


def portions_of_parts(
    basis: Basis,
    cells: Index,
    count: int,
    state: NDArray[np.int8],
    facing: Array,
    pieces: tuple[Pieces, ...],
    labels: Labels,
    first: Index,
    parts: int,
) -> Portions:
    """Shares of each of the `parts` of cells in their voxels.

    A voxel is integrated along the axes that the surface faces there. `cells` (k, 3), `count`,
    `state` (k, count^3), `pieces` and `labels` are as in `carillon.fem.finite_cells.parts`,
    `facing` (k, count^3, 3) as in `carillon.fem.finite_cells.inside.shares_of_axes`; `first` (k,)
    is each cell's first part.
    """
    lines = np.zeros(parts)
    full_cell, full_voxel = np.nonzero(state == FULL)
    label = labels[full_cell, *(BOXES * voxel_places(count)[full_voxel]).T].astype(np.int64)
    full_part = first[full_cell] + label - 1
    np.add.at(lines, full_part, pieces[0].lines ** 2)
    found = [Portions(full_part, full_voxel, basis.line_voxels(count)[full_voxel], lines)]
    bounds, primitive = box_bounds(pieces), _primitive(basis)
    spreads = [[_across(basis, each, count) for each in axis.across] for axis in pieces]
    step = max(1, AT_ONCE // max(1, int((state == CUT).sum(axis=1).max(initial=1))))
    for begin in range(0, len(cells), step):
        few = slice(begin, begin + step)
        own = _numbers_of(labels[few], state[few] == CUT, count)
        cell, voxel, label = np.nonzero(own >= 0)
        weights = np.zeros((len(cell), len(basis.lines) ** 3))
        for each, across, ends in zip(pieces, spreads, bounds, strict=True):
            chosen = np.where(state[few] == CUT, facing[few][..., each.axis], 0.0)
            of_cells = cells[few], count, chosen, each.axis, labels[few], first[few], own
            along = each.start, each.low, each.high, each.columns
            _integrate(*of_cells, along, across[0], across[1], ends, primitive, weights, lines)
        part = first[few][cell] + label - 1
        found.append(Portions(part, voxel, weights, lines))
    part, voxel = (
        np.concatenate([getattr(each, name) for each in found]) for name in ("part", "voxel")
    )
    order = np.lexsort((voxel, part))
    weights = np.concatenate([each.weights for each in found])[order]
    return Portions(part[order], voxel[order], weights, lines / pieces[0].lines ** 2)


def _numbers_of(labels: Labels, cut: NDArray[np.bool_], count: int) -> NDArray[np.int32]:
    """Number (k, count^3, parts + 1) of what a part of a cell has of a voxel, -1 if nothing."""
    boxes = labels.reshape(len(labels), *(count, BOXES) * 3)
    # In the order of voxels, x fastest, and the boxes in each.
    boxes = boxes.transpose(0, 5, 3, 1, 2, 4, 6).reshape(len(labels), count**3, -1)
    there = np.zeros((*boxes.shape[:2], int(labels.max(initial=0)) + 1), dtype=bool)
    for part in range(1, there.shape[2]):
        there[:, :, part] = (boxes == part).any(axis=2) & cut
    return np.where(there, np.cumsum(there.ravel()).reshape(there.shape) - 1, -1).astype(np.int32)


def _across(basis: Basis, spread: Spread, count: int) -> Array:
    """Lagrange polynomials (n, l, q) at the lines in their cells, times shares of the cell."""
    voxel = np.arange(len(spread.places))
    places = (voxel[:, None] % count + spread.places) / count
    values = lagrange(basis.lines, places.ravel()).reshape(*places.shape, -1)
    return np.asarray(spread.shares[:, :, None] / count * values)


def _primitive(basis: Basis) -> Array:
    """Integrals (q, q + 1) of lines' Lagrange polynomials, as sums of Legendre's on [0, 1]."""
    legendre = np.polynomial.legendre
    size = len(basis.lines)
    series = np.linalg.inv(legendre.legvander(2.0 * basis.lines - 1.0, size - 1))
    return np.ascontiguousarray(0.5 * legendre.legint(series).T)


@numba.njit(cache=True, nogil=True)
def _integrate(  # type: ignore[no-untyped-def]
    cells,
    count,
    chosen,
    axis,
    labels,
    first,
    own,
    pieces,
    lines_b,
    lines_c,
    bounds,
    primitive,
    weights,
    lines,
):
    start, low, high, columns = pieces
    n, boxes, size = lines_b.shape[1], BOXES, len(primitive)
    b, c = (axis + 1) % 3, (axis + 2) % 3
    stride = np.array([1, size, size * size])
    steps = stride[b], stride[c], stride[axis]
    along, sums = np.empty(size), np.zeros((size, size))
    at, local = np.empty(3, dtype=np.int64), np.empty(3, dtype=np.int64)
    for k in range(len(cells)):
        for number_in in range(count**3):
            share = chosen[k, number_in]
            if share == 0.0:
                continue
            local[0], local[1] = number_in % count, number_in // count % count
            local[2] = number_in // count**2
            voxel, voxel_b = cells[k, axis] + local[axis], cells[k, b] + local[b]
            voxel_c = cells[k, c] + local[c]
            for i in range(n):
                current = -1
                for j in range(n):
                    line = (voxel_b * n + i) * columns + voxel_c * n + j
                    at[b] = local[b] * boxes + i * boxes // n
                    at[c] = local[c] * boxes + j * boxes // n
                    for number in range(start[line], start[line + 1]):
                        begin = max(low[number] - voxel, 0.0)
                        end = min(high[number] - voxel, 1.0)
                        if end <= begin:
                            continue
                        box = 0
                        while box < boxes - 1 and bounds[voxel, box] <= 0.5 * (begin + end):
                            box += 1
                        at[axis] = local[axis] * boxes + box
                        part = labels[k, at[0], at[1], at[2]]
                        if part == 0:
                            continue
                        _along(
                            (local[axis] + begin) / count,
                            (local[axis] + end) / count,
                            primitive,
                            along,
                        )
                        lines[first[k] + part - 1] += share
                        to = own[k, number_in, part]
                        if to != current:
                            if current >= 0:
                                _add(weights[current], sums, lines_b[voxel_b, i], steps)
                            sums[:] = 0.0
                            current = to
                        for mc in range(size):
                            factor = share * lines_c[voxel_c, j, mc]
                            for ma in range(size):
                                sums[mc, ma] += factor * along[ma]
                if current >= 0:
                    _add(weights[current], sums, lines_b[voxel_b, i], steps)


@numba.njit(cache=True, nogil=True)
def _add(weights, sums, factors, steps):  # type: ignore[no-untyped-def]
    size = len(sums)
    step_b, step_c, step_a = steps
    for mb in range(size):
        for mc in range(size):
            place = step_b * mb + step_c * mc
            for ma in range(size):
                weights[place + step_a * ma] += factors[mb] * sums[mc, ma]


@numba.njit(cache=True, nogil=True)
def _along(begin, end, primitive, result):  # type: ignore[no-untyped-def]
    """Integrals of the Lagrange polynomials of the lines."""
    size = len(result)
    x, y = 2.0 * begin - 1.0, 2.0 * end - 1.0
    result[:] = 0.0
    x0, x1, y0, y1 = 1.0, x, 1.0, y
    for degree in range(1, size + 1):
        for m in range(size):
            result[m] += primitive[m, degree] * (y1 - x1)
        x0, x1 = x1, ((2 * degree + 1) * x * x1 - degree * x0) / (degree + 1)
        y0, y1 = y1, ((2 * degree + 1) * y * y1 - degree * y0) / (degree + 1)
