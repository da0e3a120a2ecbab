"""The inside of a surface with holes, where crossings alone do not tell.

The winding number is followed from crossing to crossing through the voxels that are cut, and
computed where that does not lead to what the next voxel has.
"""

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index
from carillon.fem.element import CORNERS
from carillon.fem.finite_cells.lines import (
    CUT,
    EMPTY,
    FULL,
    SKIPPED,
    Crossings,
    Lines,
    Pieces,
    joined,
    points_on,
)
from carillon.fem.geometry.winding import INSIDE, Winding

ENDS = 0.02
"""Share of a piece of a line by which its ends are moved inwards to see whether they are inside."""
RIM_POINTS = 9
"""Points at which winding numbers are found on a piece with one end inside that the rim of a hole
cuts."""
VAGUENESS = 0.25
"""Distance of a winding number from a whole one beyond which holes are near."""
SHEET = 0.55
"""Winding number that there is somewhere inside a solid; about a sheet it is a half at most."""
SAMPLE = 500
"""Pieces of lines that are asked for it."""
VAGUE = 127
"""Level of a voxel near a hole."""


def classify(state: NDArray[np.int8], wind: Winding) -> NDArray[np.int8]:
    """Tell voxels inside from those outside where no line crosses the surface.

    Returns the winding number (nx, ny, nz) in the middle of each voxel, rounded; `VAGUE` where it
    is far from whole somewhere in the voxel, as about holes.
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


def pieces_of_open_surface(
    lines: Crossings, state: NDArray[np.int8], levels: NDArray[np.int8], wind: Winding, ends: bool
) -> Pieces:
    """Pieces of lines inside, of states and levels (nx, ny, nz) as `classify` has them.

    `ends` tells whether the lattice ends outside the surface.
    """
    axes = (lines.axis + 1) % 3, (lines.axis + 2) % 3, lines.axis
    turned = [np.ascontiguousarray(each.transpose(axes)) for each in (state, levels)]
    low, high, line, inside, unsure = _in_voxels(
        lines.start, lines.place, lines.step, lines.columns, turned[0], turned[1], ends, lines.lines
    )
    asked = np.flatnonzero(unsure)
    if len(asked):
        length = high[asked] - low[asked]
        near = np.stack([low[asked] + ENDS * length, high[asked] - ENDS * length])
        first, last = wind.inside(points_on(lines, line[asked], near).reshape(-1, 3)).reshape(2, -1)
        inside[asked] = first | last
        split, begins = asked[first != last], first[first != last]
        if len(split):
            at = _rim(lines, line[split], low[split], high[split], begins, wind)
            high[split[begins]], low[split[~begins]] = at[begins], at[~begins]
    return joined(lines, line[inside], low[inside], high[inside])


def encloses(pieces: Pieces, wind: Winding) -> bool:
    """Whether the winding number passes `SHEET` somewhere in them, by a sample of their middles."""
    chosen = np.unique(np.linspace(0, len(pieces.low) - 1, SAMPLE).astype(np.int64))
    line = np.searchsorted(pieces.start, chosen, side="right") - 1
    middles = 0.5 * (pieces.low + pieces.high)[chosen]
    return bool(np.abs(wind(points_on(pieces, line, middles))).max() > SHEET)


def _rim(lines: Lines, line: Index, low: Array, high: Array, begins: Flags, wind: Winding) -> Array:
    """Places (p,) where pieces that begin inside, or end there, pass the rim of a hole."""
    share = np.linspace(0.0, 1.0, RIM_POINTS)[:, None]
    places = low + (ENDS + (1.0 - 2.0 * ENDS) * share) * (high - low)
    numbers = np.abs(wind(points_on(lines, line, places).reshape(-1, 3))).reshape(places.shape)
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
