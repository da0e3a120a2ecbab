"""Where lines through a lattice cross a surface, and their pieces that are inside.

Lines run along each axis through Gauss points of the voxels' sides. Where a line enters and leaves
the solid is found exactly and nothing is sampled along it, so that integrals over the inside are
sharp. Across the lines they are so too where walls lie in planes of the axes: such planes split the
edges that the points are spread on.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index
from carillon.fem.geometry.crossings import line_crossings

LINES, MORE_LINES = 16, 32
"""Lines along each side of a voxel; of a larger one, in which more of a closed surface bends, the
latter. Even, so that none lies in its plane of symmetry. With half as many, walls of a twentieth of
the spacing that stand askew have frequencies up to 0.4 % too low, and stems as wide as the spacing
twist up to 1 % too slowly."""
LARGE = 1.0 / 48.0
"""Edge of larger voxels, over the longest side of the surface."""

ALONG_AXIS = 1e-6
"""Sine of the angle between a triangle's normal and an axis up to which it counts as in a plane."""
BESIDE = 1e-4
"""Distance [voxels] from the end of an edge, or from another plane, below which none splits it."""
EDGES = 1e-6
"""Distance [voxels] from the lattice up to which a crossing is of its outermost voxels."""
MOST_PLANES = 2
"""Planes that split an edge at most, those with most area."""
EMPTY, CUT, FULL, SKIPPED = 0, 1, 2, 3
"""States of a voxel; skipped are those that nobody asked for."""
TOUCHING = 1e-9
"""Gap [voxels] between two pieces that are one."""


def lines_along(edge: float, longest: float) -> int:
    """Lines along the edge of a voxel of a surface whose longest side is given, both [m]."""
    return MORE_LINES if edge > LARGE * longest else LINES


@dataclass(frozen=True)
class Spread:
    """Places of the lines on the edges of the voxels along one axis."""

    places: Array
    """(n, l) in each voxel, from 0 to 1."""
    shares: Array
    """(n, l) their weights, of sum one."""
    bounds: Array
    """(n, l - 1) bounds between the pieces of an edge that the lines stand for."""

    @property
    def lines(self) -> int:
        """Number of lines along the edge of a voxel."""
        return self.places.shape[1]

    @property
    def coordinates(self) -> Array:
        """Coordinates (n l,) of the lines in lattice units."""
        return (np.arange(len(self.places))[:, None] + self.places).ravel()


def spread_lines(
    vertices: Array, faces: Index, count: int, axis: int, lines: int = LINES
) -> Spread:
    """Places of `lines` in each of `count` voxels along an axis, which planes across it split."""
    corners = vertices[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    along = np.abs(normal[:, axis])
    flat = along >= np.sqrt(1.0 - ALONG_AXIS**2) * np.linalg.norm(normal, axis=1)
    flat &= along > 0.0
    heights, area = corners[flat, 0, axis], along[flat]
    places, shares, bounds = (np.empty((count, lines + more)) for more in (0, 0, -1))
    voxels = np.floor(heights).astype(np.int64)
    for voxel in range(count):
        here = voxels == voxel
        ends = _split(heights[here] - voxel, area[here])
        places[voxel], shares[voxel], bounds[voxel] = _points_between(tuple(ends), lines)
    return Spread(places, shares, bounds)


def _split(heights: Array, area: Array) -> list[float]:
    """Ends of the pieces of an edge from 0 to 1 that is split at the heights of most area."""
    ends = [0.0, 1.0]
    distinct, which = np.unique(heights, return_inverse=True)
    for height in distinct[np.argsort(-np.bincount(which, area), kind="stable")]:
        if len(ends) < MOST_PLANES + 2 and min(abs(height - end) for end in ends) > BESIDE:
            ends.append(float(height))
    return sorted(ends)


@cache
def _points_between(ends: tuple[float, ...], lines: int) -> tuple[Array, Array, Array]:
    """Places, shares and bounds of Gauss points on the pieces of an edge, more on longer ones."""
    low, high = np.array(ends[:-1]), np.array(ends[1:])
    counts = np.full(len(low), lines // len(low))
    counts[np.argsort(low - high, kind="stable")[: lines % len(low)]] += 1
    rules = [np.polynomial.legendre.leggauss(count) for count in counts]
    places = [a + (b - a) * (1.0 + at) / 2.0 for a, b, (at, _) in zip(low, high, rules)]
    shares = [(b - a) * weights / 2.0 for a, b, (_, weights) in zip(low, high, rules)]
    between = [0.5 * (at[1:] + at[:-1]) for at in places]
    bounds = [between[0]]
    for end, rest in zip(low[1:], between[1:]):
        bounds += [np.array([end]), rest]
    return np.concatenate(places), np.concatenate(shares), np.concatenate(bounds)


@dataclass(frozen=True)
class Lines:
    """Numbered places on the lines along one axis."""

    axis: int
    """That the lines run along; across it are b = axis + 1 and c = axis + 2, modulo 3."""
    across: tuple[Spread, Spread]
    """Spread of the lines across b and c: line (i, j) has the number ``i * columns + j``."""
    start: Index
    """(lines + 1,) range of each line's entries."""

    @property
    def lines(self) -> int:
        """Number of lines along the edge of a voxel."""
        return self.across[0].lines

    @property
    def columns(self) -> int:
        """Lines across c."""
        return self.across[1].places.size


@dataclass(frozen=True)
class Crossings(Lines):
    """Crossings with the triangles of a surface."""

    place: Array
    step: NDArray[np.int8]
    """(k,) see `line_crossings`, in lattice units."""


def crossings(
    vertices: Array,
    faces: Index,
    spreads: Sequence[Spread],
    axis: int,
    requested: Flags | None = None,
) -> Crossings:
    """Crossings of the lines along an axis through a lattice of voxels, see `line_crossings`.

    Vertices are in lattice units, `spreads` of the lines across x, y and z. Only lines through
    `requested` voxels (nx, ny, nz) are looked at, if these are given.
    """
    across = spreads[(axis + 1) % 3], spreads[(axis + 2) % 3]
    rows, columns = (each.coordinates for each in across)
    through = None
    if requested is not None:
        through = requested.any(axis=axis)
        through = through.T if axis == 1 else through
    start, place, step = line_crossings(vertices, faces, rows, columns, axis, through)
    return Crossings(axis, across, start, place, step)


def crossings_of_voxels(lines: Crossings, shape: tuple[int, int, int]) -> NDArray[np.uint16]:
    """Number (nx, ny, nz) of crossings in each voxel; those beside the lattice are of none."""
    axis = lines.axis
    among = np.flatnonzero((lines.place >= -EDGES) & (lines.place <= shape[axis] + EDGES))
    line = np.repeat(np.arange(len(lines.start) - 1), np.diff(lines.start))[among]
    row, column = np.divmod(line, lines.columns)
    place = np.clip(lines.place[among].astype(np.int64), 0, shape[axis] - 1)
    index = np.empty((3, len(line)), dtype=np.int64)
    index[axis], index[(axis + 1) % 3], index[(axis + 2) % 3] = (
        place,
        row // lines.lines,
        column // lines.lines,
    )
    flat = np.ravel_multi_index(tuple(index), shape)
    counts = np.minimum(np.bincount(flat, minlength=int(np.prod(shape))), np.iinfo(np.uint16).max)
    return counts.reshape(shape).astype(np.uint16)


@dataclass(frozen=True)
class Pieces(Lines):
    """Pieces of the lines along one axis that are inside."""

    low: Array
    high: Array
    """(k,) their ends in lattice units, ascending on each line."""


def joined(lines: Lines, line: Index, low: Array, high: Array) -> Pieces:
    """Pieces of which those that follow each other without a gap are one."""
    follows = np.zeros(len(line), dtype=bool)
    follows[1:] = (line[1:] == line[:-1]) & (low[1:] - high[:-1] <= TOUCHING)
    first = np.flatnonzero(~follows)
    last = np.append(first, len(line))[1:] - 1
    start = np.searchsorted(line[first], np.arange(len(lines.start)))
    return Pieces(lines.axis, lines.across, start, low[first], high[last])


def points_on(lines: Lines, line: Index, place: Array) -> Array:
    """Points (..., p, 3) in lattice units at places (..., p) on lines (p,)."""
    row, column = np.divmod(line, lines.columns)
    points = np.empty((*place.shape, 3))
    points[..., lines.axis] = place
    for more, number in enumerate((row, column)):
        points[..., (lines.axis + 1 + more) % 3] = lines.across[more].coordinates[number]
    return points
