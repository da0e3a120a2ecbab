"""Lines across voxels, divided where the region changes, and what is integrated along them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index
from carillon.fem.finite_cells.basis import Basis, lagrange
from carillon.fem.finite_cells.cells import FiniteCells

RegionsAt = Callable[[Array], NDArray[np.integer]]
"""Region (p,) of points (p, 3) [m]; -1 where there is none."""
InsideAt = Callable[[Array], NDArray[np.bool_]]
"""Whether points (p, 3) [m] are inside the solid."""

STEPS = 8
"""Intervals of a line across a voxel, at whose ends regions are compared."""
BISECTIONS, BISECTIONS_OF_SURFACE = 24, 7
"""Bisections for a border of regions, and for the solid's surface, whose volume is known."""
GROUPS = 2
"""Groups of four Gauss points, in which the lines across a voxel lie, along each of its edges."""
AT_ONCE = 500_000
"""Points whose regions are found at once."""
PIECES_AT_ONCE = 8192
"""Pieces of lines that are integrated at once: 48 MB."""


@dataclass(frozen=True)
class Boxes:
    """Voxels of finite cells, or cells no larger than one."""

    cells: FiniteCells
    portion: Index
    """(k,) which of the parts that cells have of voxels are in them."""

    groups = GROUPS
    """Groups of lines along each edge."""

    def some(self, chosen: Index) -> Self:
        """A few of them."""
        return replace(self, portion=self.portion[chosen])

    @property
    def weights(self) -> Array:
        """Weights (k, d) of the cells' points, see `FiniteCells`."""
        return np.asarray(self.cells.weights[self.cells.row[self.portion]])

    @cached_property
    def local(self) -> tuple[Array, Array]:
        """Lowest corners (k, 3) and edges (k,) in cells of edge one."""
        low, edge = self.cells.frames()
        return low[self.portion], edge[self.portion]

    @cached_property
    def is_cut(self) -> Flags:
        """Which (k,) the surface cuts."""
        return np.asarray(self.cells.shares[self.portion] <= (1.0 - 1e-9) * self.local[1] ** 3)

    @cached_property
    def frames(self) -> tuple[Array, Array]:
        """Lowest corners (k, 3) and edges (k, 3, 3) [m], in columns."""
        cells, (low, edge) = self.cells, self.local
        cell = cells.cell[self.portion]
        corner = cells.origin + cells.step * cells.corner[cell]
        edges = (cells.edges[cell] * edge)[:, None, None] * np.eye(3)
        return corner + cells.edges[cell, None] * low, edges

    def sampled(self, offsets: Array, function: Callable[[Array], NDArray]) -> NDArray[np.int64]:  # type: ignore[type-arg]
        """Values (k, p) of a function at places `offsets` (p, 3) in them, from 0 to 1."""
        corner, edges = self.frames
        found = np.empty((len(corner), len(offsets)), dtype=np.int64)
        step = max(1, AT_ONCE // len(offsets))
        for first in range(0, len(corner), step):
            few = slice(first, first + step)
            places = corner[few, None] + offsets @ edges[few].transpose(0, 2, 1)
            found[few] = function(places.reshape(-1, 3)).reshape(places.shape[:2])
        return found

    def points(self, box: Index, axis: Index, along: Array, across: Array) -> Array:
        """Points (p, 3) [m] in boxes (p,), at `along` (p,) an axis and `across` (p, 2), 0 to 1."""
        local = np.empty((len(box), 3))
        turned = (axis[:, None] + np.arange(3)) % 3
        np.put_along_axis(local, turned, np.column_stack([along, across]), axis=1)
        corner, edges = self.frames
        return np.asarray(corner[box] + np.einsum("pij,pj->pi", edges[box], local))

    def integrals(self, pieces: LocalPieces, group: Index, count: int) -> Array:
        """Integrals (count, d) of the points' Lagrange polynomials over pieces, by `group` (p,)."""
        return _integrals(self.cells.basis, self.local, pieces, group, count)


@dataclass(frozen=True)
class BoxParts:
    """Parts of boxes by region."""

    box: Index
    region: NDArray[np.integer]
    weights: Array
    """(e,), (e,), (e, d)."""
    border_box: Index
    border: Array
    """(b,), (b, 3) [m] where lines leave one region for another."""

    @classmethod
    def nothing(cls, points: int) -> BoxParts:
        """No parts, of cells with so many points."""
        none = np.empty(0, dtype=np.int64)
        return cls(none, none, np.empty((0, points)), none, np.empty((0, 3)))

    @classmethod
    def joined(cls, found: Sequence[BoxParts]) -> BoxParts:
        """All parts of several."""
        names = ("box", "region", "weights", "border_box", "border")
        return cls(*(np.concatenate([getattr(each, name) for each in found]) for name in names))


def parts_of_boxes(boxes: Boxes, axis: Index, regions_at: RegionsAt, inside: InsideAt) -> BoxParts:
    """Parts of boxes that lines across them along `axis` (k,) find."""
    found = []
    # A few boxes at a time, each with all of its lines.
    step = max(1, AT_ONCE // (len(_across(boxes.groups)[0]) * (STEPS + 1)))
    for first in range(0, len(axis), step):
        few = np.arange(first, min(first + step, len(axis)))
        parts = _parts(boxes.some(few), axis[few], regions_at, inside)
        found.append(replace(parts, box=few[parts.box], border_box=few[parts.border_box]))
    return BoxParts.joined(found)


def _parts(boxes: Boxes, axis: Index, regions_at: RegionsAt, inside: InsideAt) -> BoxParts:
    places, shares = _across(boxes.groups)
    lines = _Lines(boxes, axis, places, regions_at, inside)
    (line, low, high, region), (crossing, at) = _pieces(lines, len(axis) * len(places))
    box, number = np.divmod(line, len(places))
    pairs = np.stack([box, region], axis=1)
    key, where = np.unique(pairs, axis=0, return_inverse=True)
    pieces = LocalPieces(box, axis[box], places[number], low, high, shares[number])
    summed = boxes.integrals(pieces, where.ravel(), len(key))
    border = lines.points(crossing, at)
    return BoxParts(key[:, 0], key[:, 1], summed, crossing // len(places), border)


@dataclass(frozen=True)
class _Lines:
    """Lines across boxes, those of an box one after the other."""

    boxes: Boxes
    axis: Index
    places: Array
    regions_at: RegionsAt
    inside: InsideAt

    def points(self, line: Index, along: Array) -> Array:
        """Points (p, 3) [m] on lines (p,), at places along them from 0 to 1."""
        box, number = np.divmod(line, len(self.places))
        return self.boxes.points(box, self.axis[box], along, self.places[number])

    def are_cut(self, line: Index) -> Flags:
        """Which lines (p,) are in boxes that the surface cuts."""
        return self.boxes.is_cut[line // len(self.places)]

    def regions(self, line: Index, along: Array) -> NDArray[np.int64]:
        """Regions (p,) at places along lines; -1 outside the solid."""
        point = self.points(line, along)
        found = self.regions_at(point).astype(np.int64)
        cut = np.flatnonzero(self.are_cut(line))
        if len(cut):
            found[cut[~self.inside(point[cut])]] = -1
        return found

    def border(self, line: Index, low: Array, high: Array, left: NDArray[np.int64]) -> Array:
        """Places (p,) between `low` and `high` where lines leave the regions `left` (p,)."""

        def same(middle: Array) -> Flags:
            return np.asarray(self.regions_at(self.points(line, middle)) == left)

        return _bisected(same, low, high, BISECTIONS)

    def surface(self, line: Index, low: Array, high: Array, began_inside: Flags) -> Array:
        """Places (p,) where lines cross the solid's surface."""

        def same(middle: Array) -> Flags:
            return np.asarray(self.inside(self.points(line, middle)) == began_inside)

        return _bisected(same, low, high, BISECTIONS_OF_SURFACE)


def _bisected(same: Callable[[Array], Flags], low: Array, high: Array, steps: int) -> Array:
    for _ in range(steps if len(low) else 0):
        middle = 0.5 * (low + high)
        here = same(middle)
        low, high = np.where(here, middle, low), np.where(here, high, middle)
    return 0.5 * (low + high)


Pieces = tuple[Index, Array, Array, NDArray[np.int64]]
"""Lines, begins and ends from 0 to 1, and regions of pieces."""


def _pieces(lines: _Lines, count: int) -> tuple[Pieces, tuple[Index, Array]]:
    """Pieces of lines, each of one region; lines that leave one for another, and where."""
    ends = np.linspace(0.0, 1.0, STEPS + 1)
    every = np.repeat(np.arange(count), STEPS + 1)
    inset = np.clip(ends, 1e-6, 1.0 - 1e-6)
    region = lines.regions(every, np.tile(inset, count)).reshape(count, STEPS + 1)
    number, step = np.nonzero(region[:, 1:] != region[:, :-1])
    left, right = region[number, step], region[number, step + 1]
    low, high = ends[step], ends[step + 1]
    border = np.empty(len(number))
    within = (left >= 0) & (right >= 0)
    border[within] = lines.border(number[within], low[within], high[within], left[within])
    out = ~within
    border[out] = lines.surface(number[out], low[out], high[out], left[out] >= 0)
    crossings = number[within], border[within]
    # Begin and end of the pieces, line by line.
    line = np.concatenate([np.arange(count), number])
    begin = np.concatenate([np.zeros(count), border])
    of = np.concatenate([region[:, 0], right])
    order = np.lexsort((begin, line))
    line, begin, of = line[order], begin[order], of[order]
    last = np.append(line[1:] != line[:-1], True)
    end = np.where(last, 1.0, np.append(begin[1:], 1.0))
    kept = (of >= 0) & (end > begin)
    return (line[kept], begin[kept], end[kept], of[kept]), crossings


def _across(groups: int) -> tuple[Array, Array]:
    """Places (l, 2) of the lines across a voxel, and their shares of it (l,)."""
    nodes, shares = np.polynomial.legendre.leggauss(4)
    starts = np.arange(groups) / groups
    place = (starts[:, None] + (nodes + 1.0) / (2.0 * groups)).ravel()
    share = np.tile(shares / (2.0 * groups), groups)
    first, second = np.meshgrid(place, place, indexing="ij")
    return np.stack([first.ravel(), second.ravel()], axis=1), np.outer(share, share).ravel()


@dataclass(frozen=True)
class LocalPieces:
    """Pieces of lines in boxes, from 0 to 1 there."""

    box: Index
    axis: Index
    across: Array
    low: Array
    high: Array
    share: Array
    """(p,), (p,), (p, 2), (p,), (p,), (p,) of the box's section that each stands for."""


def _integrals(
    basis: Basis, local: tuple[Array, Array], pieces: LocalPieces, group: Index, count: int
) -> Array:
    """Integrals (count, d) of the points' Lagrange polynomials over pieces, by their `group` (p,).

    `local` are lowest corners (k, 3) and edges (k,) of the boxes in their cells.
    """
    nodes, shares = np.polynomial.legendre.leggauss(basis.degree + 1)
    size = len(basis.lines)
    summed = np.zeros((count, basis.n_points))
    order = np.argsort(group, kind="stable")
    # A few groups at a time, since all products of lines take much room.
    ends = np.append(np.arange(0, len(order), PIECES_AT_ONCE), len(order))
    for begin, end in zip(ends[:-1], ends[1:]):
        few = order[begin:end]
        corner, edge = local[0][pieces.box[few]], local[1][pieces.box[few]]
        axis, rows = pieces.axis[few], np.arange(len(few))
        low, length = pieces.low[few], (pieces.high - pieces.low)[few]
        along = np.zeros((len(few), size))
        for node, share in zip(nodes, shares, strict=True):
            place = corner[rows, axis] + edge * (low + length * (node + 1.0) / 2.0)
            along += (0.5 * share * length * edge)[:, None] * lagrange(basis.lines, place)
        factors = np.empty((len(few), 3, size))
        factors[rows, axis] = along * (edge**2 * pieces.share[few])[:, None]
        for number in (1, 2):
            other = (axis + number) % 3
            place = corner[rows, other] + edge * pieces.across[few, number - 1]
            factors[rows, other] = lagrange(basis.lines, place)
        product = np.einsum("pk,pj,pi->pkji", factors[:, 2], factors[:, 1], factors[:, 0])
        own, where = np.unique(group[few], return_inverse=True)
        matrix = sp.csr_matrix((np.ones(len(few)), (where.ravel(), rows)), (len(own), len(few)))
        summed[own] += (matrix @ product.reshape(len(few), -1)) @ basis.from_lines
    return summed
