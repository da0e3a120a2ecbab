"""Which pieces of the lattice's lines are inside a surface, and which voxels it cuts.

Inside is where the winding number is not about zero, as for voxels. Of a closed surface the
crossings tell it; see `carillon.fem.finite_cells.open_surfaces` for others. Of a wall it is what
lies in any of the convex bodies that it is made of.
"""

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Surface
from carillon.fem.finite_cells.lines import (
    CUT,
    EMPTY,
    FULL,
    LINES,
    SKIPPED,
    Crossings,
    Pieces,
    Spread,
    crossings,
    crossings_of_voxels,
    joined,
    lines_along,
    points_on,
    spread_lines,
)
from carillon.fem.finite_cells.open_surfaces import classify, encloses, pieces_of_open_surface
from carillon.fem.finite_cells.wall_lines import (
    length,
    line_ends,
    pieces_in_bodies,
    shared,
    spread_in_wall,
)
from carillon.fem.geometry.grid import Grid
from carillon.fem.geometry.walls import INSIDE, OUTSIDE, Wall
from carillon.fem.geometry.winding import Winding

LEAST_SHARE = 0.01
"""Share of an axis below which its lines are left out."""


@dataclass(frozen=True)
class Inside:
    """The inside of a surface on a lattice."""

    state: NDArray[np.int8]
    """(nx, ny, nz) int8: `EMPTY`, `CUT`, `FULL` or `SKIPPED`."""
    crossed: NDArray[np.uint16]
    """(nx, ny, nz, 3) uint16: how often the surface crosses the lines along x, y and z in a voxel,
    see `shares_of_axes`."""
    pieces: tuple[Pieces, Pieces, Pieces]
    """Pieces of lattice lines that lie inside, for the lines along x, y and z."""
    sheet: bool = False
    """Whether the surface is open and goes around nothing."""

    def volumes(self) -> tuple[float, float]:
        """Volume [voxels] in the voxels that are cut, by one half of the lines and by the other."""
        halves, facing = np.zeros(2), shares_of_axes(self.crossed)
        for each in self.pieces:
            share = np.where(self.state == CUT, facing[..., each.axis], 0.0)
            axes = (each.axis + 1) % 3, (each.axis + 2) % 3, each.axis
            turned = np.ascontiguousarray(share.transpose(axes))
            shares = [spread.shares for spread in each.across]
            _add_volumes(each.start, each.low, each.high, turned, shares[0], shares[1], halves)
        return float(halves[0]), float(halves[1])


def find_inside(surface: Surface | Wall, grid: Grid, requested: Flags | None = None) -> Inside:
    """The inside of a surface, which may have holes and overlapping shells, or of a wall.

    The lattice holds all of it, unless voxels (nx, ny, nz) are requested.
    """
    if isinstance(surface, Wall):
        return _inside_of_wall(surface, grid, requested)
    import trimesh

    merged = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    merged.merge_vertices()
    vertices = np.ascontiguousarray((merged.vertices - grid.origin) / grid.edge)
    faces = np.ascontiguousarray(merged.faces, dtype=np.int64)
    closed = bool(merged.is_watertight and merged.is_winding_consistent)
    longest = float(np.ptp(merged.vertices, axis=0).max())
    lines = lines_along(grid.edge, longest) if closed else LINES
    spreads = [spread_lines(vertices, faces, grid.shape[axis], axis, lines) for axis in range(3)]
    crossed = [crossings(vertices, faces, spreads, axis, requested) for axis in range(3)]
    state, crossed_often = _states(crossed, grid, requested)
    wind = Winding(surface, grid)
    sheet = False
    if closed:
        pieces = [_of_closed_surface(each, wind) for each in crossed]
        _fill(state, pieces[0])
    else:
        levels = classify(state, wind)
        ends = requested is None
        pieces = [pieces_of_open_surface(each, state, levels, wind, ends) for each in crossed]
        there = [each for each in pieces if len(each.low)]
        sheet = bool(there) and not any(encloses(each, wind) for each in there)
    return Inside(state, crossed_often, (pieces[0], pieces[1], pieces[2]), sheet)


def shares_of_axes(crossed: NDArray[np.integer]) -> Array:
    """Shares (..., 3) of the lines along x, y and z in what a voxel that is cut holds.

    They go by the square of how often the surface crosses these (..., 3), as the squares of its
    normal's components do, so that they change little from voxel to voxel, and what ends between
    the lines of one is in the next.
    """
    squares = crossed.astype(np.float64) ** 2
    squares[squares < LEAST_SHARE * squares.sum(axis=-1, keepdims=True)] = 0.0
    total = squares.sum(axis=-1, keepdims=True)
    return np.asarray(squares / np.where(total > 0.0, total, 1.0))


def pieces_of_closed_surface(wall: Wall, spreads: list[Spread], grid: Grid) -> list[Pieces]:
    """Pieces of the lines along x, y and z inside the closed surface that a wall follows."""
    vertices, faces = wall.surface_on(grid)
    wind = Winding(wall.surface, grid)
    crossed = (crossings(vertices, faces, spreads, axis) for axis in range(3))
    return [_of_closed_surface(each, wind) for each in crossed]


def fills(wall: Wall, inside: Inside, grid: Grid) -> bool:
    """Whether a wall leaves nothing of the hollow in the closed surface that it follows."""
    if not wall.sheets.is_closed or wall.side == OUTSIDE:
        return False
    along_x = inside.pieces[0]
    # The lines of the wall, which were spread by its own faces.
    hollow = pieces_of_closed_surface(wall, spread_in_wall(wall, grid), grid)[0]
    return length(hollow) > 0.0 and not len(shared(hollow, along_x, False).low)


def _inside_of_wall(wall: Wall, grid: Grid, requested: Flags | None) -> Inside:
    spreads, bodies = spread_in_wall(wall, grid), wall.bodies_on(grid)
    asked = np.ones(grid.shape, dtype=bool) if requested is None else requested
    pieces = [pieces_in_bodies(bodies, spreads, axis, asked) for axis in range(3)]
    if wall.is_of_inside:
        inner = pieces_of_closed_surface(wall, spreads, grid)
        pieces = [
            shared(each, own, wall.side == INSIDE) for each, own in zip(pieces, inner, strict=True)
        ]
    state, crossed = _states([line_ends(each) for each in pieces], grid, requested)
    _fill(state, pieces[0])
    return Inside(state, crossed, (pieces[0], pieces[1], pieces[2]))


def _states(
    crossed: list[Crossings], grid: Grid, requested: Flags | None
) -> tuple[NDArray[np.int8], NDArray[np.uint16]]:
    """State of each voxel, `FULL` ones still `EMPTY`, and how often it is crossed."""
    counts = np.stack([crossings_of_voxels(each, grid.shape) for each in crossed], axis=3)
    state = np.where(counts.any(axis=3), CUT, EMPTY).astype(np.int8)
    if requested is not None:
        state[~requested] = SKIPPED
    return state, counts


def _fill(state: NDArray[np.int8], along_x: Pieces) -> None:
    """Make voxels `FULL` that no line crosses and whose middle is inside."""
    lines = along_x.start, along_x.low, along_x.high, along_x.columns
    state[(state == EMPTY) & _middles_inside(*lines, along_x.lines, state.shape)] = FULL


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
                if chosen[b, c, voxel] > 0.0:
                    length = min(high[number], voxel + 1.0) - max(low[number], float(voxel))
                    halves[half] += chosen[b, c, voxel] * area * length
