"""Which pieces of the lattice's lines are inside a surface, and which voxels it cuts.

Inside is where the winding number is not about zero, as for voxels. Of a closed surface the
crossings tell it. Where there are holes, it is followed from crossing to crossing through the
voxels that are cut, and computed where that does not lead to what the next voxel has.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.fem.element import CORNERS
from carillon.fem.finite_cells.lines import (
    LINES,
    Crossings,
    Lines,
    crossings,
    crossings_of_voxels,
    spread_lines,
)
from carillon.fem.geometry.fill import INSIDE, Grid, cut, winding_numbers

if TYPE_CHECKING:  # Its import takes long, and many commands need no surface.
    import trimesh

Array = NDArray[np.float64]
Index = NDArray[np.int64]

EMPTY, CUT, FULL, SKIPPED = 0, 1, 2, 3
"""States of a voxel; skipped are those that nobody asked for."""
ENDS = 0.02
"""Share of a piece of a line by which its ends are moved inwards to see whether they are inside."""
RIM_POINTS = 9
"""Of a piece with one end inside, which the rim of a hole cuts, where winding numbers are found."""
VAGUENESS = 0.25
"""Distance of a winding number from a whole one beyond which holes are near."""
SHEET = 0.55
"""Winding number that there is somewhere inside a solid; about a sheet it is a half at most."""
SAMPLE = 500
"""Pieces of lines that are asked for it."""
VAGUE = 127
"""Level of a voxel near a hole."""
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


@dataclass(frozen=True)
class Inside:
    """The inside of a surface on a lattice.

    Attributes
    ----------
    state : (nx, ny, nz) int8
        `EMPTY`, `CUT`, `FULL` or `SKIPPED`.
    facing : (nx, ny, nz) int8
        Axis whose lines the surface crosses most often in a voxel, as it does face on.
    pieces
        Of the lines along x, y and z.
    sheet
        Whether the surface is open and goes around nothing.
    """

    state: NDArray[np.int8]
    facing: NDArray[np.int8]
    pieces: tuple[Pieces, Pieces, Pieces]
    sheet: bool = False

    def volumes(self) -> tuple[float, float]:
        """Volume [voxels] in the voxels that are cut, by one half of the lines and by the other."""
        halves = np.zeros(2)
        for each in self.pieces:
            chosen = (self.state == CUT) & (self.facing == each.axis)
            axes = (each.axis + 1) % 3, (each.axis + 2) % 3, each.axis
            turned = np.ascontiguousarray(chosen.transpose(axes))
            shares = [spread.shares for spread in each.across]
            _add_volumes(each.start, each.low, each.high, turned, shares[0], shares[1], halves)
        return float(halves[0]), float(halves[1])


def find_inside(
    surface: trimesh.Trimesh, grid: Grid, wanted: NDArray[np.bool_] | None = None
) -> Inside:
    """The inside of a surface, which may have holes and overlapping shells.

    The lattice holds all of the surface, unless it is told which voxels are `wanted` (nx, ny, nz).
    """
    import trimesh

    merged = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    merged.merge_vertices()
    vertices = np.ascontiguousarray((merged.vertices - grid.origin) / grid.edge)
    faces = np.ascontiguousarray(merged.faces, dtype=np.int64)
    x, y, z = (spread_lines(vertices, faces, grid.shape[axis], axis) for axis in range(3))
    crossed = [crossings(vertices, faces, (x, y, z), axis) for axis in range(3)]
    counts = np.stack([crossings_of_voxels(each, grid.shape) for each in crossed], axis=3)
    state = np.where(counts.any(axis=3), CUT, EMPTY).astype(np.int8)
    facing = counts.argmax(axis=3).astype(np.int8)
    if wanted is not None:
        state[~wanted] = SKIPPED
    wind = _Winding(surface, grid)
    sheet = False
    if merged.is_watertight and merged.is_winding_consistent:
        pieces = [_of_closed_surface(each, wind) for each in crossed]
        state[(state == EMPTY) & _middles(pieces[0], grid.shape)] = FULL
    else:
        levels = _classify(state, wind)
        ends = wanted is None
        pieces = [_of_open_surface(each, state, levels, wind, ends) for each in crossed]
        there = [each for each in pieces if len(each.low)]
        sheet = bool(there) and not any(_encloses(each, wind) for each in there)
    return Inside(state, facing, (pieces[0], pieces[1], pieces[2]), sheet)


class _Winding:
    """Winding numbers about points in lattice units."""

    def __init__(self, surface: trimesh.Trimesh, grid: Grid) -> None:
        self._surface, self._grid = surface, grid
        self._cut: trimesh.Trimesh | None = None

    def __call__(self, points: Array) -> Array:
        if self._cut is None:
            self._cut = cut(self._surface, 2 * self._grid.edge)
        return winding_numbers(self._cut, self._grid, points)

    def inside(self, points: Array) -> NDArray[np.bool_]:
        """Whether they are inside."""
        return np.asarray(np.abs(self(points)) > INSIDE)


def _of_closed_surface(lines: Crossings, wind: _Winding) -> Pieces:
    low, high, line, certain = _between_crossings(lines.start, lines.place, lines.step)
    unsure = np.flatnonzero(certain < 0)
    inside = certain > 0
    if len(unsure):
        # Lines that rounding let slip through an edge.
        inside[unsure] = wind.inside(_points(lines, line[unsure], 0.5 * (low + high)[unsure]))
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


def _classify(state: NDArray[np.int8], wind: _Winding) -> NDArray[np.int8]:
    """Tell voxels inside from those outside where no line crosses the surface.

    Returns
    -------
    NDArray[np.int8]
        (nx, ny, nz) the winding number in the middle of each voxel, rounded; `VAGUE` where it is
        far from whole somewhere in the voxel, as about holes.
    """
    shape = state.shape
    there = np.argwhere(state != SKIPPED)
    corners = (there[:, None] + CORNERS).reshape(-1, 3)
    sizes = tuple(size + 1 for size in shape)
    keys, which = np.unique(np.ravel_multi_index(tuple(corners.T), sizes), return_inverse=True)
    points = np.stack(np.unravel_index(keys, sizes), axis=1).astype(float)
    corner = wind(points)[which].reshape(-1, len(CORNERS))
    middle = wind(there + 0.5)
    agree = ((np.abs(corner) > INSIDE) == (np.abs(middle) > INSIDE)[:, None]).all(axis=1)
    numbers = np.column_stack([corner, middle])
    vague = (np.abs(numbers - np.rint(numbers)) > VAGUENESS).any(axis=1)
    own = tuple(there.T)
    plain = state[own] == EMPTY
    known = np.where(agree, np.where(np.abs(middle) > INSIDE, FULL, EMPTY), CUT)
    state[own] = np.where(plain, known, state[own])
    levels = np.zeros(shape, dtype=np.int8)
    levels[own] = np.where(vague, VAGUE, np.rint(middle))
    return levels


def _of_open_surface(
    lines: Crossings,
    state: NDArray[np.int8],
    levels: NDArray[np.int8],
    wind: _Winding,
    ends: bool,
) -> Pieces:
    axes = (lines.axis + 1) % 3, (lines.axis + 2) % 3, lines.axis
    turned = [np.ascontiguousarray(each.transpose(axes)) for each in (state, levels)]
    low, high, line, inside, unsure = _in_voxels(
        lines.start, lines.place, lines.step, lines.columns, turned[0], turned[1], ends, LINES
    )
    asked = np.flatnonzero(unsure)
    if len(asked):
        length = high[asked] - low[asked]
        near = np.stack([low[asked] + ENDS * length, high[asked] - ENDS * length])
        first, last = wind.inside(_points(lines, line[asked], near).reshape(-1, 3)).reshape(2, -1)
        inside[asked] = first | last
        split, begins = asked[first != last], first[first != last]
        if len(split):
            at = _rim(lines, line[split], low[split], high[split], begins, wind)
            high[split[begins]], low[split[~begins]] = at[begins], at[~begins]
    return _joined(lines, line[inside], low[inside], high[inside])


def _encloses(pieces: Pieces, wind: _Winding) -> bool:
    """Whether the winding number passes `SHEET` somewhere in them, by a sample of their middles."""
    chosen = np.unique(np.linspace(0, len(pieces.low) - 1, SAMPLE).astype(np.int64))
    line = np.searchsorted(pieces.start, chosen, side="right") - 1
    middles = 0.5 * (pieces.low + pieces.high)[chosen]
    return bool(np.abs(wind(_points(pieces, line, middles))).max() > SHEET)


def _rim(
    lines: Lines, line: Index, low: Array, high: Array, begins: NDArray[np.bool_], wind: _Winding
) -> Array:
    """Places (p,) where pieces that begin inside, or end there, pass the rim of a hole."""
    share = np.linspace(0.0, 1.0, RIM_POINTS)[:, None]
    places = low + (ENDS + (1.0 - 2.0 * ENDS) * share) * (high - low)
    numbers = np.abs(wind(_points(lines, line, places).reshape(-1, 3))).reshape(places.shape)
    after = np.argmax((numbers > INSIDE) != begins, axis=0)
    own = np.arange(len(line))
    one, other = numbers[after - 1, own], numbers[after, own]
    weight = np.clip((INSIDE - one) / np.where(one == other, 1.0, other - one), 0.0, 1.0)
    return places[after - 1, own] * (1.0 - weight) + places[after, own] * weight


@numba.njit(cache=True, nogil=True)
def _in_voxels(  # type: ignore[no-untyped-def]
    start, place, step, columns, state, levels, ends, n
):
    """Pieces of lines in voxels that are not empty: ends, line, whether inside, and whether unsure.

    The winding number is followed from crossing to crossing through voxels that are cut. Where it
    then is not that of the next voxel, or a voxel is vague, crossings do not tell. Where a lattice
    ends it is zero, if the lattice `ends` outside the surface.
    """
    low, high, owner = [0.0][:0], [0.0][:0], [0][:0]
    inside, unsure = [False][:0], [False][:0]
    for line in range(len(start) - 1):
        row, column = line // columns // n, line % columns // n
        number = start[line]
        winding, run, vague = 0, len(low), False
        for voxel in range(state.shape[2] + 1):
            kind, level = EMPTY, 0
            if voxel < state.shape[2]:
                kind, level = state[row, column, voxel], levels[row, column, voxel]
            else:
                level = 0 if ends else winding
            if kind == SKIPPED:
                while number < start[line + 1] and place[number] < voxel + 1.0:
                    winding += step[number]
                    number += 1
                continue
            if kind != CUT:
                if vague or winding != level:
                    for piece in range(run, len(low)):
                        unsure[piece] = True
                winding, vague = level, level == VAGUE
                if kind == FULL:
                    low.append(float(voxel))
                    high.append(voxel + 1.0)
                    owner.append(line)
                    inside.append(True)
                    unsure.append(False)
                while number < start[line + 1] and place[number] < voxel + 1.0:
                    number += 1
                run = len(low)
                continue
            vague = vague or level == VAGUE
            begin = float(voxel)
            while True:
                crossed = number < start[line + 1] and place[number] < voxel + 1.0
                end = min(max(place[number], begin), voxel + 1.0) if crossed else voxel + 1.0
                if end > begin:
                    low.append(begin)
                    high.append(end)
                    owner.append(line)
                    inside.append(winding != 0)
                    unsure.append(False)
                begin = end
                if not crossed:
                    break
                winding += step[number]
                number += 1
    return np.array(low), np.array(high), np.array(owner), np.array(inside), np.array(unsure)


def _joined(lines: Lines, line: Index, low: Array, high: Array) -> Pieces:
    """Pieces of which those that follow each other without a gap are one."""
    follows = np.zeros(len(line), dtype=bool)
    follows[1:] = (line[1:] == line[:-1]) & (low[1:] - high[:-1] <= TOUCHING)
    first = np.flatnonzero(~follows)
    last = np.append(first, len(line))[1:] - 1
    start = np.searchsorted(line[first], np.arange(len(lines.start)))
    return Pieces(lines.axis, lines.across, start, low[first], high[last])


def _points(lines: Lines, line: Index, place: Array) -> Array:
    """Points (..., p, 3) in lattice units at places (..., p) on lines (p,)."""
    row, column = np.divmod(line, lines.columns)
    points = np.empty((*place.shape, 3))
    points[..., lines.axis] = place
    for more, number in enumerate((row, column)):
        points[..., (lines.axis + 1 + more) % 3] = lines.across[more].coordinates[number]
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


@numba.njit(cache=True, nogil=True)
def _add_volumes(start, low, high, chosen, rows, columns, halves):  # type: ignore[no-untyped-def]
    """Add the volume in chosen voxels, by the lines for which i + j is even and by the others."""
    n = rows.shape[1]
    for line in range(len(start) - 1):
        b, i = divmod(line // columns.size, n)
        c, j = divmod(line % columns.size, n)
        half = (i + j) & 1
        even_b, even_c = rows[b, ::2].sum(), columns[c, ::2].sum()
        share = even_b * even_c + (1.0 - even_b) * (1.0 - even_c)
        area = rows[b, i] * columns[c, j] / (1.0 - share if half else share)
        for number in range(start[line], start[line + 1]):
            for voxel in range(max(int(low[number]), 0), chosen.shape[2]):
                if voxel >= high[number]:
                    break
                if chosen[b, c, voxel]:
                    length = min(high[number], voxel + 1.0) - max(low[number], float(voxel))
                    halves[half] += area * length
