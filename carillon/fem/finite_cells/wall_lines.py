"""Pieces of a lattice's lines that lie in a wall."""

import numba
import numpy as np

from carillon.arrays import Flags
from carillon.fem.finite_cells.lines import (
    TOUCHING,
    Crossings,
    Pieces,
    Spread,
    lines_along,
    spread_lines,
)
from carillon.fem.geometry.convex import ConvexBodies, line_pieces
from carillon.fem.geometry.grid import Grid
from carillon.fem.geometry.walls import Wall


def spread_in_wall(wall: Wall, grid: Grid) -> list[Spread]:
    """Places of the lines across x, y and z, which planes of the wall's faces split."""
    vertices, faces = wall.faces_on(grid)
    lines = lines_along(grid.edge, float(np.ptp(vertices, axis=0).max()) * grid.edge)
    return [spread_lines(vertices, faces, grid.shape[axis], axis, lines) for axis in range(3)]


def pieces_in_bodies(
    bodies: ConvexBodies, spreads: list[Spread], axis: int, requested: Flags
) -> Pieces:
    """Pieces of the lines along an axis in bodies, through requested voxels (nx, ny, nz)."""
    b, c = (axis + 1) % 3, (axis + 2) % 3
    across = spreads[b], spreads[c]
    chosen = requested.transpose(b, c, axis).any(axis=2)
    rows, columns = (each.coordinates for each in across)
    return Pieces(axis, across, *line_pieces(bodies, rows, columns, axis, chosen))


def shared(one: Pieces, other: Pieces, is_inside: bool) -> Pieces:
    """Pieces of `one` in `other`, or beside it if not `is_inside`; both are on the same lines."""
    start, low, high = _shared(
        one.start, one.low, one.high, other.start, other.low, other.high, is_inside
    )
    return Pieces(one.axis, one.across, start, low, high)


def line_ends(pieces: Pieces) -> Crossings:
    """Where the lines enter and leave."""
    place = np.stack([pieces.low, pieces.high], axis=1).ravel()
    step = np.tile(np.array([1, -1], dtype=np.int8), len(pieces.low))
    return Crossings(pieces.axis, pieces.across, 2 * pieces.start, place, step)


def length(pieces: Pieces) -> float:
    """Length of all pieces together [voxels]."""
    return float((pieces.high - pieces.low).sum())


@numba.njit(cache=True, nogil=True)
def _shared(start, low, high, other_start, other_low, other_high, is_inside):  # type: ignore[no-untyped-def]
    size = len(low) + len(other_low)
    found_low, found_high, count = np.empty(size), np.empty(size), 0
    found_start = np.zeros(len(start), dtype=np.int64)
    for line in range(len(start) - 1):
        first = other_start[line]
        for number in range(start[line], start[line + 1]):
            begin, end = low[number], high[number]
            while first < other_start[line + 1] and other_high[first] <= begin:
                first += 1
            other = first
            while begin < end:
                there = other < other_start[line + 1] and other_low[other] < end
                one = max(begin, other_low[other]) if there else end
                two = min(end, other_high[other]) if there else end
                left, right = (one, two) if is_inside else (begin, one)
                if right - left > TOUCHING:
                    found_low[count], found_high[count] = left, right
                    count += 1
                begin = two
                other += 1
        found_start[line + 1] = count
    return found_start, found_low[:count].copy(), found_high[:count].copy()
