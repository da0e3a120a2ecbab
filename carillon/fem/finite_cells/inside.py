"""Which pieces of the lattice's lines are inside a surface, and which voxels it cuts.

Inside is where the winding number is not about zero, as for voxels. Of a closed surface the
crossings tell it; see `carillon.fem.finite_cells.open_surfaces` for others.
"""

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Flags, Surface
from carillon.fem.finite_cells.lines import (
    CUT,
    EMPTY,
    FULL,
    LINES,
    SKIPPED,
    Crossings,
    Pieces,
    crossings,
    crossings_of_voxels,
    joined,
    points_on,
    spread_lines,
)
from carillon.fem.finite_cells.open_surfaces import classify, encloses, pieces_of_open_surface
from carillon.fem.geometry.grid import Grid
from carillon.fem.geometry.winding import Winding


@dataclass(frozen=True)
class Inside:
    """The inside of a surface on a lattice."""

    state: NDArray[np.int8]
    """(nx, ny, nz) int8: `EMPTY`, `CUT`, `FULL` or `SKIPPED`."""
    facing: NDArray[np.int8]
    """(nx, ny, nz) int8: axis whose lines the surface crosses most often in a voxel, as it does
    face on."""
    pieces: tuple[Pieces, Pieces, Pieces]
    """Pieces of lattice lines that lie inside, for the lines along x, y and z."""
    sheet: bool = False
    """Whether the surface is open and goes around nothing."""

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


def find_inside(surface: Surface, grid: Grid, requested: Flags | None = None) -> Inside:
    """The inside of a surface, which may have holes and overlapping shells.

    The lattice holds all of the surface, unless voxels (nx, ny, nz) are requested.
    """
    import trimesh

    merged = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    merged.merge_vertices()
    vertices = np.ascontiguousarray((merged.vertices - grid.origin) / grid.edge)
    faces = np.ascontiguousarray(merged.faces, dtype=np.int64)
    spreads = [spread_lines(vertices, faces, grid.shape[axis], axis) for axis in range(3)]
    crossed = [crossings(vertices, faces, spreads, axis) for axis in range(3)]
    counts = np.stack([crossings_of_voxels(each, grid.shape) for each in crossed], axis=3)
    state = np.where(counts.any(axis=3), CUT, EMPTY).astype(np.int8)
    facing = counts.argmax(axis=3).astype(np.int8)
    if requested is not None:
        state[~requested] = SKIPPED
    wind = Winding(surface, grid)
    sheet = False
    if merged.is_watertight and merged.is_winding_consistent:
        pieces = [_of_closed_surface(each, wind) for each in crossed]
        x = pieces[0]
        middles = _middles_inside(x.start, x.low, x.high, x.columns, LINES, grid.shape)
        state[(state == EMPTY) & middles] = FULL
    else:
        levels = classify(state, wind)
        ends = requested is None
        pieces = [pieces_of_open_surface(each, state, levels, wind, ends) for each in crossed]
        there = [each for each in pieces if len(each.low)]
        sheet = bool(there) and not any(encloses(each, wind) for each in there)
    return Inside(state, facing, (pieces[0], pieces[1], pieces[2]), sheet)


def _of_closed_surface(lines: Crossings, wind: Winding) -> Pieces:
    line = np.repeat(np.arange(len(lines.start) - 1), np.diff(lines.start))
    passed = np.append(0, np.cumsum(lines.step, dtype=np.int64))
    before, after = passed[lines.start[:-1]], passed[lines.start[1:]]
    piece = np.flatnonzero(line[1:] == line[:-1])
    low, high, line = lines.place[piece], lines.place[piece + 1], line[piece]
    inside = passed[piece + 1] != before[line]
    unsure = np.flatnonzero((after != before)[line])
    if len(unsure):
        # Lines that rounding let slip through an edge.
        inside[unsure] = wind.inside(points_on(lines, line[unsure], 0.5 * (low + high)[unsure]))
    return joined(lines, line[inside], low[inside], high[inside])


@numba.njit(cache=True, nogil=True)
def _middles_inside(start, low, high, columns, n, shape):  # type: ignore[no-untyped-def]
    """Voxels whose middle is inside, as their first line along x sees it."""
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
