"""Finite cells whose inside is of several regions: each is integrated over its own part.

A voxel may be of two regions, and be cut by the surface besides. Lines across it are divided where
the region changes, which is found by bisection, so that regions need not follow the lattice.
Displacements stay quadratic in the cell: where stiffness jumps, strains jump too, which one
polynomial does not follow.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Index
from carillon.fem.element import CORNERS
from carillon.fem.finite_cells.cells import FLOOR, FiniteCells
from carillon.fem.finite_cells.shapes import (
    OCTANTS,
    POINT_PLACES,
    POINTS,
    lagrange,
    octant_weights,
)
from carillon.fem.regions import RegionOf, Regions

RegionsAt = Callable[[Array], NDArray[np.integer]]
"""Region (p,) of points (p, 3) [m]; -1 where there is none."""

SAMPLES = (0.02, 0.5, 0.98)
"""Places along a voxel's edge at which regions are looked for."""
STEPS = 8
"""Intervals of a line across a voxel, at whose ends regions are compared."""
BISECTIONS = 24
LINES = 2
"""Groups of Gauss points, in which the lines across a voxel lie, along each of its edges."""
AT_ONCE = 500_000
"""Points whose regions are found at once."""


@dataclass(frozen=True, eq=False)
class SharedCells:
    """Parts of voxels that are of several regions, all of whose arrays have a row for each."""

    cell: Index
    octant: Index
    """(e,) where it is."""
    region: RegionOf
    """(e,) what it is of."""
    weights: Array
    """(e, 125) integrals of the points' Lagrange polynomials over it, see `FiniteCells`."""


def regions_of_cells(
    cells: FiniteCells, regions_at: RegionsAt, inside: Callable[[Array], NDArray[np.bool_]]
) -> tuple[RegionOf, SharedCells | None, NDArray[np.bool_]]:
    """Region (m,) that most of each voxel is of, parts of those that several share, and which (m,)
    voxels are of none.

    `inside` tells whether points (p, 3) [m] are inside the solid's surface.
    """
    cell, octant = np.nonzero(cells.voxels >= 0)
    frames = _Frames(cells, cell, octant)
    offsets = np.array([[x, y, z] for z in SAMPLES for y in SAMPLES for x in SAMPLES])
    seen = _at(frames, np.broadcast_to(offsets, (len(cell), *offsets.shape)), regions_at)
    cut = np.flatnonzero(~_is_whole(cells, cell, octant))
    mixed = cut[_varies(seen[cut])]
    if len(mixed):
        few = _Frames(cells, cell[mixed], octant[mixed])
        chosen = np.broadcast_to(offsets, (len(mixed), *offsets.shape))
        outside = ~_at(few, chosen, inside).astype(bool)
        left = np.where(outside, -1, seen[mixed])
        # Too thin for the samples: all of them count.
        seen[mixed] = np.where((left < 0).all(axis=1, keepdims=True), seen[mixed], left)
    region = np.array([_most(row) for row in seen])
    split = np.flatnonzero(_varies(seen))
    shared = None
    if len(split):
        few = _Frames(cells, cell[split], octant[split])
        shared = _split(cells, few, seen[split], regions_at, inside)
        volume = np.zeros((len(cell), int(seen.max()) + 1))
        row = np.zeros(cells.voxels.shape, dtype=np.int64)
        row[cell, octant] = np.arange(len(cell))
        np.add.at(volume, (row[shared.cell, shared.octant], shared.region), shared.weights.sum(1))
        region[split] = volume[split].argmax(axis=1)
    # A voxel's octants, of a divided cell, are all in it: the largest decides.
    share = cells.fractions[cell, octant]
    order = np.argsort(share, kind="stable")
    of_voxel = np.full(cells.mesh.n_cells, -1)
    of_voxel[cells.voxels[cell, octant][order]] = region[order]
    nowhere = of_voxel < 0
    return np.maximum(of_voxel, 0).astype(np.uint16), shared, nowhere


def point_values(
    cells: FiniteCells,
    region: RegionOf,
    shared: SharedCells | None,
    of_voxel: Array,
    of_part: Array | None,
) -> tuple[Array, RegionOf]:
    """Weighted values (c, s, 125) at the points of cells by region, and the regions (c, s).

    `of_voxel` (m,) are the values of voxels, `of_part` (e,) those of shared parts. See
    `FiniteCells.point_values`; a cell of fewer regions has its first one again.
    """
    there = cells.voxels >= 0
    own = np.where(there, region[cells.voxels], 0).astype(np.int64)
    whole = there.copy()
    if shared is not None:
        whole[shared.cell, shared.octant] = False
    law, slot = _slots(cells, own, whole, shared)
    values = np.zeros((*law.shape, POINTS))
    volume, total = np.zeros(law.shape), np.zeros(law.shape)

    def add(cell: Index, at: Index, value: Array, weights: Array) -> None:
        np.add.at(values, (cell, at), value[:, None] * weights)
        share = weights.sum(axis=1)
        np.add.at(volume, (cell, at), share)
        np.add.at(total, (cell, at), value * share)

    for octant in range(OCTANTS):
        cell = np.flatnonzero(whole[:, octant])
        weights = cells.weights[cells.row[cell], octant]
        add(cell, slot[cell, octant], of_voxel[cells.voxels[cell, octant]], weights)
    if shared is not None:
        assert of_part is not None
        at = (law[shared.cell] == shared.region[:, None]).argmax(axis=1)
        add(shared.cell, at, of_part, shared.weights)
    main = volume.argmax(axis=1)
    mean = total.sum(axis=1) / volume.sum(axis=1)
    everything = octant_weights().sum(axis=0)
    values[np.arange(len(law)), main] += FLOOR * mean[:, None] * everything
    return values, law


def point_moduli(
    cells: FiniteCells,
    regions: Regions,
    region: RegionOf,
    shared: SharedCells | None,
    young: Array,
) -> tuple[Array, RegionOf]:
    """Weighted moduli [Pa] of voxels with moduli `young` (m,) [Pa], see `point_values`.

    A part of another region than its voxel has that region's modulus, times the same factor.
    """
    of_part = None
    if shared is not None:
        voxel = cells.voxels[shared.cell, shared.octant]
        of_part = young[voxel] / regions.young[region[voxel]] * regions.young[shared.region]
    return point_values(cells, region, shared, young, of_part)


def point_shares(
    cells: FiniteCells, regions: Regions, region: RegionOf, shared: SharedCells | None
) -> Array:
    """Weighted densities (c, 125) at the points of cells, over that of the first region."""
    density = regions.density / regions.density[0]
    of_part = None if shared is None else density[shared.region]
    return np.asarray(point_values(cells, region, shared, density[region], of_part)[0].sum(axis=1))


def _slots(
    cells: FiniteCells, own: Index, whole: NDArray[np.bool_], shared: SharedCells | None
) -> tuple[RegionOf, Index]:
    """Regions (c, s) of each cell, and the place (c, 8) of each octant's among them."""
    cell, octant = np.nonzero(whole)
    number = own[cell, octant]
    if shared is not None:
        cell, number = np.append(cell, shared.cell), np.append(number, shared.region)
    pairs = np.unique(np.stack([cell, number], axis=1), axis=0)
    first = np.searchsorted(pairs[:, 0], np.arange(len(cells)))
    place = np.arange(len(pairs)) - first[pairs[:, 0]]
    law = np.repeat(pairs[first, 1][:, None], int(place.max()) + 1, axis=1)
    law[pairs[:, 0], place] = pairs[:, 1]
    slot = (law[:, None] == own[:, :, None]).argmax(axis=2)
    return law.astype(np.uint16), slot


@dataclass(frozen=True)
class _Frames:
    """Octants of cells as cubes."""

    cells: FiniteCells
    cell: Index
    octant: Index
    """(k,) which."""

    def corner(self) -> tuple[Array, Array]:
        """Lowest corners (k, 3) and edges (k,) [m]."""
        mesh = self.cells.mesh
        edge = self.cells.span[self.cell] / 2.0
        lowest = self.cells.grid[self.cell] + edge[:, None] * CORNERS[self.octant]
        return mesh.origin + mesh.edge * lowest, mesh.edge * edge


def _at(frames: _Frames, offsets: Array, function: Callable[[Array], NDArray]) -> NDArray[np.int64]:  # type: ignore[type-arg]
    """Values (k, p) of a function at places (k, p, 3) in octants, from 0 to 1."""
    corner, edge = frames.corner()
    found = np.empty(offsets.shape[:2], dtype=np.int64)
    step = max(1, AT_ONCE // offsets.shape[1])
    for first in range(0, len(corner), step):
        few = slice(first, first + step)
        places = corner[few, None] + edge[few, None, None] * offsets[few]
        found[few] = function(places.reshape(-1, 3)).reshape(places.shape[:2])
    return found


def _is_whole(cells: FiniteCells, cell: Index, octant: Index) -> NDArray[np.bool_]:
    return np.asarray(cells.fractions[cell, octant] > 1.0 - 1e-9)


def _varies(seen: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether samples (k, p) are of several regions, those of none aside."""
    most = seen.max(axis=1)
    return np.asarray((np.where(seen < 0, most[:, None], seen) != most[:, None]).any(axis=1))


def _most(row: NDArray[np.int64]) -> int:
    """The region that most samples (p,) are of; -1 if there is none."""
    there = row[row >= 0]
    return int(np.bincount(there).argmax()) if len(there) else -1


def _split(
    cells: FiniteCells,
    frames: _Frames,
    seen: NDArray[np.int64],
    regions_at: RegionsAt,
    inside: Callable[[Array], NDArray[np.bool_]],
) -> SharedCells:
    """Parts of octants that lines across them find."""
    whole = _is_whole(cells, frames.cell, frames.octant)
    axes = _axes_across(seen)
    places, shares = _across()
    rows: list[NDArray[np.int64]] = []
    columns: list[NDArray[np.int64]] = []
    parts: list[Array] = []
    # A few octants at a time, each with all of its lines.
    step = max(1, AT_ONCE // (len(places) * (STEPS + 1)))
    for first in range(0, len(frames.cell), step):
        few = np.arange(first, min(first + step, len(frames.cell)))
        some = _Frames(cells, frames.cell[few], frames.octant[few])

        def at(line: Index, along: Array, some: _Frames = some, few: Index = few) -> Index:
            """Regions at places along lines; -1 outside the solid."""
            octant, number = np.divmod(line, len(places))
            axis = axes[few][octant]
            local = np.empty((len(line), 3))
            turned = (axis[:, None] + np.arange(3)) % 3
            both = np.concatenate([along[:, None], places[number]], axis=1)
            np.put_along_axis(local, turned, both, axis=1)
            corner, edge = some.corner()
            point = corner[octant] + edge[octant, None] * local
            found = regions_at(point).astype(np.int64)
            cut = np.flatnonzero(~whole[few][octant])
            if len(cut):
                found[cut[~inside(point[cut])]] = -1
            return found

        line, low, high, region = _pieces(at, len(few) * len(places))
        octant, number = np.divmod(line, len(places))
        own = frames.octant[few][octant]
        axis = axes[few][octant]
        weights = _integrals(own, axis, places[number], low, high) * (shares[number] * 1.0)[:, None]
        key, where = np.unique(np.stack([few[octant], region], axis=1), axis=0, return_inverse=True)
        summed = np.zeros((len(key), POINTS))
        np.add.at(summed, where.ravel(), weights)
        rows.append(key[:, 0])
        columns.append(key[:, 1])
        parts.append(summed)
    row, region, weights = np.concatenate(rows), np.concatenate(columns), np.concatenate(parts)
    most = np.array([_most(samples) for samples in seen])
    return _complete(cells, frames, row, region, weights, most)


def _complete(
    cells: FiniteCells, frames: _Frames, row: Index, region: Index, weights: Array, most: Index
) -> SharedCells:
    """The parts, with what lines missed of an octant in the largest of it, or in region `most`."""
    exact = cells.weights[cells.row[frames.cell], frames.octant]
    found = np.zeros_like(exact)
    np.add.at(found, row, weights)
    volume = weights.sum(axis=1)
    largest = np.full(len(exact), -1)
    order = np.argsort(volume, kind="stable")
    largest[row[order]] = order
    missed = np.flatnonzero(largest < 0)
    if len(missed):  # slivers between the lines
        largest[missed] = len(row) + np.arange(len(missed))
        row, region = np.append(row, missed), np.append(region, most[missed])
        weights = np.concatenate([weights, np.zeros((len(missed), POINTS))])
    weights[largest] += exact - found
    return SharedCells(frames.cell[row], frames.octant[row], region.astype(np.uint16), weights)


def _axes_across(seen: NDArray[np.int64]) -> Index:
    """Axis (k,) along which regions change most often between samples (k, 27)."""
    cube = seen.reshape(-1, 3, 3, 3)
    counts = []
    for axis in (3, 2, 1):
        low = np.take(cube, [0, 1], axis=axis)
        high = np.take(cube, [1, 2], axis=axis)
        changes = (low != high) & (low >= 0) & (high >= 0)
        counts.append(changes.sum(axis=(1, 2, 3)))
    return np.asarray(np.stack(counts, axis=1).argmax(axis=1))


def _across() -> tuple[Array, Array]:
    """Places (l, 2) of the lines across a voxel, and their shares of it (l,)."""
    nodes, shares = np.polynomial.legendre.leggauss(4)
    starts = np.arange(LINES) / LINES
    place = (starts[:, None] + (nodes + 1.0) / (2.0 * LINES)).ravel()
    share = np.tile(shares / (2.0 * LINES), LINES)
    first, second = np.meshgrid(place, place, indexing="ij")
    return np.stack([first.ravel(), second.ravel()], axis=1), np.outer(share, share).ravel()


def _pieces(at: Callable[[Index, Array], Index], lines: int) -> tuple[Index, Array, Array, Index]:
    """Pieces of lines, each of one region: line, begin and end from 0 to 1, and region."""
    ends = np.linspace(0.0, 1.0, STEPS + 1)
    inset = np.clip(ends, 1e-6, 1.0 - 1e-6)
    line = np.repeat(np.arange(lines), STEPS + 1)
    region = at(line, np.tile(inset, lines)).reshape(lines, STEPS + 1)
    number, step = np.nonzero(region[:, 1:] != region[:, :-1])
    low, high = ends[step].copy(), ends[step + 1].copy()
    left = region[number, step]
    for _ in range(BISECTIONS if len(number) else 0):
        middle = 0.5 * (low + high)
        same = at(number, middle) == left
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    border = 0.5 * (low + high)
    # Begin and end of the pieces, line by line.
    begins = np.concatenate(
        [np.stack([np.arange(lines), np.zeros(lines)], 1), np.stack([number, border], 1)]
    )
    of = np.concatenate([region[:, 0], region[number, step + 1]])
    order = np.lexsort((begins[:, 1], begins[:, 0]))
    line, begin, of = begins[order, 0].astype(np.int64), begins[order, 1], of[order]
    last = np.append(line[1:] != line[:-1], True)
    end = np.where(last, 1.0, np.append(begin[1:], 1.0))
    kept = (of >= 0) & (end > begin)
    return line[kept], begin[kept], end[kept], of[kept]


def _integrals(octant: Index, axis: Index, across: Array, low: Array, high: Array) -> Array:
    """Integrals (p, 125) of the points' Lagrange polynomials over pieces of lines in octants."""
    nodes, shares = np.polynomial.legendre.leggauss(3)
    length = high - low
    half = CORNERS[octant]
    along = np.zeros((len(octant), 5))
    of_axis = half[np.arange(len(octant)), axis]
    for node, share in zip(nodes, shares, strict=True):
        place = (of_axis + low + length * (node + 1.0) / 2.0) / 2.0
        along += (0.5 * share * length)[:, None] * lagrange(POINT_PLACES, place)
    factors = np.empty((len(octant), 3, 5))
    rows = np.arange(len(octant))
    factors[rows, axis] = along
    for number in (1, 2):
        other = (axis + number) % 3
        place = (half[rows, other] + across[:, number - 1]) / 2.0
        factors[rows, other] = lagrange(POINT_PLACES, place)
    product = np.einsum("pk,pj,pi->pkji", factors[:, 2], factors[:, 1], factors[:, 0])
    # An octant has an eighth of the cell.
    return np.asarray(product.reshape(len(octant), POINTS) / OCTANTS)
