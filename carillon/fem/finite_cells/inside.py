"""Which pieces of the lattice's lines are inside a surface, and which voxels it cuts.

Inside is where the winding number is not about zero, as for voxels. Of a closed surface the
crossings tell it; where a surface has holes, winding numbers are computed at the ends of the pieces
between crossings, in voxels that are not inside or outside as a whole.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numba
import numpy as np
import trimesh
from numpy.typing import NDArray

from carillon.fem.finite_cells.lines import (
    LINE_PLACES,
    LINE_SHARES,
    LINES,
    Crossings,
    Lines,
    crossings,
    crossings_of_voxels,
)
from carillon.fem.geometry.fill import Grid, cut, inside_points

Array = NDArray[np.float64]
Index = NDArray[np.int64]

EMPTY, CUT, FULL = 0, 1, 2
"""States of a voxel."""
ENDS = 0.02
"""Share of a piece of a line by which its ends are moved inwards to see whether they are inside."""
HALVINGS = 10
"""Of a piece with one end inside, which the rim of a hole cuts."""
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

    @property
    def volume(self) -> float:
        """Volume of the solid by these lines alone, in voxels."""
        line = np.repeat(np.arange(len(self.start) - 1), np.diff(self.start))
        row, column = np.divmod(line, self.columns)
        share = LINE_SHARES[row % LINES] * LINE_SHARES[column % LINES]
        return float(share @ (self.high - self.low))


@dataclass(frozen=True)
class Inside:
    """The inside of a surface on a lattice.

    Attributes
    ----------
    state : (nx, ny, nz) int8
        `EMPTY`, `CUT` or `FULL`.
    facing : (nx, ny, nz) int8
        Axis whose lines the surface crosses most often in a voxel, as it does face on.
    pieces
        Of the lines along x, y and z.
    """

    state: NDArray[np.int8]
    facing: NDArray[np.int8]
    pieces: tuple[Pieces, Pieces, Pieces]


def find_inside(surface: trimesh.Trimesh, grid: Grid) -> Inside:
    """The inside of a surface, which may have holes and overlapping shells."""
    merged = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    merged.merge_vertices()
    vertices = np.ascontiguousarray((merged.vertices - grid.origin) / grid.edge)
    faces = np.ascontiguousarray(merged.faces, dtype=np.int64)
    crossed = [crossings(vertices, faces, grid.shape, axis) for axis in range(3)]
    counts = np.stack([crossings_of_voxels(each, grid.shape) for each in crossed], axis=3)
    state = np.where(counts.any(axis=3), CUT, EMPTY).astype(np.int8)
    facing = counts.argmax(axis=3).astype(np.int8)
    test = _Test(surface, grid)
    if merged.is_watertight and merged.is_winding_consistent:
        pieces = [_of_closed_surface(each, test) for each in crossed]
        state[(state == EMPTY) & _middles(pieces[0], grid.shape)] = FULL
    else:
        _classify(state, test)
        pieces = [_of_open_surface(each, state, test) for each in crossed]
    return Inside(state, facing, (pieces[0], pieces[1], pieces[2]))


class _Test:
    """Whether points in lattice units are inside the surface, by winding numbers."""

    def __init__(self, surface: trimesh.Trimesh, grid: Grid) -> None:
        self._surface, self._grid = surface, grid
        self._cut: trimesh.Trimesh | None = None

    def __call__(self, points: Array) -> NDArray[np.bool_]:
        if self._cut is None:
            # The hierarchy behind fast winding numbers suffers from long triangles.
            self._cut = cut(self._surface, 2 * self._grid.edge)
        return inside_points(self._cut, self._grid, points)


def _of_closed_surface(lines: Crossings, test: Callable[[Array], NDArray[np.bool_]]) -> Pieces:
    low, high, line, certain = _between_crossings(lines.start, lines.place, lines.step)
    unsure = np.flatnonzero(certain < 0)
    inside = certain > 0
    if len(unsure):
        # Lines that rounding let slip through an edge.
        inside[unsure] = test(_points(lines, line[unsure], 0.5 * (low + high)[unsure]))
    return _joined(lines, line[inside], low[inside], high[inside])


@numba.njit(cache=True, nogil=True)
def _between_crossings(start, place, step):  # type: ignore[no-untyped-def]
    """Pieces between crossings: ends, line, and whether inside; -1 where crossings do not tell."""
    count = 0
    for line in range(len(start) - 1):
        count += max(start[line + 1] - start[line] - 1, 0)
    low, high = np.empty(count), np.empty(count)
    owner, certain = np.empty(count, dtype=np.int64), np.empty(count, dtype=np.int8)
    count = 0
    for line in range(len(start) - 1):
        total = 0
        for number in range(start[line], start[line + 1]):
            total += step[number]
        winding = 0
        for number in range(start[line], start[line + 1] - 1):
            winding += step[number]
            low[count], high[count] = place[number], place[number + 1]
            owner[count] = line
            certain[count] = -1 if total != 0 else (1 if winding != 0 else 0)
            count += 1
    return low, high, owner, certain


def _classify(state: NDArray[np.int8], test: Callable[[Array], NDArray[np.bool_]]) -> None:
    """Tell voxels inside from those outside where no line crosses the surface."""
    shape = state.shape
    corners = np.indices([size + 1 for size in shape]).reshape(3, -1).T.astype(float)
    at_corners = test(corners).reshape([size + 1 for size in shape])
    middle = test(np.indices(shape).reshape(3, -1).T + 0.5).reshape(shape)
    agree = np.ones(shape, dtype=bool)
    for x in range(2):
        for y in range(2):
            for z in range(2):
                corner = at_corners[
                    x : x + shape[0], y : y + shape[1], z : z + shape[2]
                ]
                agree &= corner == middle
    plain = (state == EMPTY) & agree
    state[plain & middle] = FULL
    state[(state == EMPTY) & ~agree] = CUT


def _of_open_surface(
    lines: Crossings, state: NDArray[np.int8], test: Callable[[Array], NDArray[np.bool_]]
) -> Pieces:
    turned = np.ascontiguousarray(
        state.transpose((lines.axis + 1) % 3, (lines.axis + 2) % 3, lines.axis)
    )
    low, high, line, whole = _in_voxels(lines.start, lines.place, lines.columns, turned, LINES)
    inside = whole.copy()
    asked = np.flatnonzero(~whole)
    length = high[asked] - low[asked]
    first = test(_points(lines, line[asked], low[asked] + ENDS * length))
    last = test(_points(lines, line[asked], high[asked] - ENDS * length))
    inside[asked] = first | last
    mixed = first != last
    split, begins = asked[mixed], first[mixed]
    left, right = low[split].copy(), high[split].copy()
    for _ in range(HALVINGS):
        middle = 0.5 * (left + right)
        onwards = test(_points(lines, line[split], middle)) == begins
        left, right = np.where(onwards, middle, left), np.where(onwards, right, middle)
    high[split[begins]], low[split[~begins]] = left[begins], right[~begins]
    return _joined(lines, line[inside], low[inside], high[inside])


@numba.njit(cache=True, nogil=True)
def _in_voxels(start, place, columns, state, n):  # type: ignore[no-untyped-def]
    """Pieces of lines in full voxels, and between crossings in cut ones; and whether the former."""
    low, high, owner, whole = [0.0][:0], [0.0][:0], [0][:0], [False][:0]
    for line in range(len(start) - 1):
        row, column = line // columns, line % columns
        number = start[line]
        for voxel in range(state.shape[2]):
            kind = state[row // n, column // n, voxel]
            begin = float(voxel)
            while number < start[line + 1] and place[number] < voxel + 1.0:
                at = min(max(place[number], begin), voxel + 1.0)
                if kind == 1 and at > begin:
                    low.append(begin)
                    high.append(at)
                    owner.append(line)
                    whole.append(False)
                begin = at
                number += 1
            if kind != 0 and begin < voxel + 1.0:
                low.append(begin)
                high.append(voxel + 1.0)
                owner.append(line)
                whole.append(kind == 2)
    return np.array(low), np.array(high), np.array(owner), np.array(whole)


def _joined(lines: Lines, line: Index, low: Array, high: Array) -> Pieces:
    """Pieces of which those that follow each other without a gap are one."""
    follows = np.zeros(len(line), dtype=bool)
    follows[1:] = (line[1:] == line[:-1]) & (low[1:] - high[:-1] <= TOUCHING)
    first = np.flatnonzero(~follows)
    last = np.append(first[1:], len(line)) - 1
    start = np.searchsorted(line[first], np.arange(len(lines.start)))
    return Pieces(lines.axis, lines.columns, start, low[first], high[last])


def _points(lines: Lines, line: Index, place: Array) -> Array:
    """Points (p, 3) in lattice units at places on lines."""
    row, column = np.divmod(line, lines.columns)
    points = np.empty((len(line), 3))
    points[:, lines.axis] = place
    points[:, (lines.axis + 1) % 3] = row // LINES + LINE_PLACES[row % LINES]
    points[:, (lines.axis + 2) % 3] = column // LINES + LINE_PLACES[column % LINES]
    return points


def _middles(pieces: Pieces, shape: tuple[int, int, int]) -> NDArray[np.bool_]:
    """Voxels (nx, ny, nz) whose middle is inside, as their first line along x sees it."""
    return np.asarray(
        _middles_inside(pieces.start, pieces.low, pieces.high, pieces.columns, LINES, shape)
    )


@numba.njit(cache=True, nogil=True)
def _middles_inside(start, low, high, columns, n, shape):  # type: ignore[no-untyped-def]
    result = np.zeros(shape, dtype=np.bool_)
    for y in range(shape[1]):
        for z in range(shape[2]):
            line = y * n * columns + z * n
            for number in range(start[line], start[line + 1]):
                for x in range(max(int(np.ceil(low[number] - 0.5)), 0), shape[0]):
                    if x + 0.5 > high[number]:
                        break
                    result[x, y, z] = True
    return result
