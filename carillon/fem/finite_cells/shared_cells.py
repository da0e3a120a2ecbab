"""Finite cells whose inside is of several regions: each is integrated over its own part.

A voxel may be of two regions, and be cut by the surface besides. Lines across it are divided where
the region changes, which is found by bisection, so that regions need not follow the lattice.
Displacements stay quadratic in the cell: where stiffness jumps, strains jump too, which one
polynomial does not follow.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Index
from carillon.fem.finite_cells.cells import FLOOR, FiniteCells
from carillon.fem.finite_cells.region_lines import InsideAt, Octants, RegionsAt, parts_of_octants
from carillon.fem.finite_cells.shapes import OCTANTS, POINTS, octant_weights
from carillon.fem.regions import RegionOf, Regions

SAMPLES = (0.02, 0.5, 0.98)
"""Places along a voxel's edge at which regions are looked for."""


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
    cells: FiniteCells, regions_at: RegionsAt, inside: InsideAt
) -> tuple[RegionOf, SharedCells | None, NDArray[np.bool_]]:
    """Region (m,) that most of each voxel is of, parts of those that several share, and which (m,)
    voxels are of none.

    `inside` tells whether points (p, 3) [m] are inside the solid's surface.
    """
    cell, octant = np.nonzero(cells.voxels >= 0)
    octants = Octants(cells, cell, octant)
    offsets = np.array([[x, y, z] for z in SAMPLES for y in SAMPLES for x in SAMPLES])
    seen = octants.sampled(offsets, regions_at)
    cut = np.flatnonzero(octants.is_cut)
    mixed = cut[_varies(seen[cut])]
    if len(mixed):
        is_inside = octants.some(mixed).sampled(offsets, inside).astype(bool)
        left = np.where(is_inside, seen[mixed], -1)
        # Too thin for the samples: all of them count.
        seen[mixed] = np.where((left < 0).all(axis=1, keepdims=True), seen[mixed], left)
    region = seen.max(axis=1)
    split = np.flatnonzero(_varies(seen))
    shared = None
    if len(split):
        shared = _split(octants.some(split), seen[split], regions_at, inside)
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
    shares = cells.weights.sum(axis=2)
    for octant in range(OCTANTS):
        cell = np.flatnonzero(whole[:, octant])
        row, at = cells.row[cell], slot[cell, octant]
        value = of_voxel[cells.voxels[cell, octant]]
        values[cell, at] += value[:, None] * cells.weights[row, octant]
        volume[cell, at] += shares[row, octant]
        total[cell, at] += value * shares[row, octant]
    if shared is not None:
        assert of_part is not None
        at = (law[shared.cell] == shared.region[:, None]).argmax(axis=1)
        share = shared.weights.sum(axis=1)
        np.add.at(values, (shared.cell, at), of_part[:, None] * shared.weights)
        np.add.at(volume, (shared.cell, at), share)
        np.add.at(total, (shared.cell, at), of_part * share)
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


def point_shares(cells: FiniteCells, region: RegionOf, shared: SharedCells | None) -> Array:
    """Weights (c, s, 125) of the points by region, see `point_values`."""
    of_part = None if shared is None else np.ones(len(shared.region))
    return point_values(cells, region, shared, np.ones(len(region)), of_part)[0]


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


def _varies(seen: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether samples (k, p) are of several regions, those of none aside."""
    most = seen.max(axis=1)
    return np.asarray((np.where(seen < 0, most[:, None], seen) != most[:, None]).any(axis=1))


def _most(row: NDArray[np.int64]) -> int:
    """The region that most samples (p,) are of; -1 if there is none."""
    there = row[row >= 0]
    return int(np.bincount(there).argmax()) if len(there) else -1


def _split(
    octants: Octants, seen: NDArray[np.int64], regions_at: RegionsAt, inside: InsideAt
) -> SharedCells:
    """Parts of octants; what the lines miss is of the largest part, or of the commonest sample."""
    row, region, weights = parts_of_octants(octants, _axes_across(seen), regions_at, inside)
    exact = octants.weights
    found = np.zeros_like(exact)
    np.add.at(found, row, weights)
    largest = np.full(len(exact), -1)
    order = np.argsort(weights.sum(axis=1), kind="stable")
    largest[row[order]] = order
    missed = np.flatnonzero(largest < 0)
    if len(missed):  # slivers between the lines
        largest[missed] = len(row) + np.arange(len(missed))
        most = [_most(samples) for samples in seen[missed]]
        row, region = np.append(row, missed), np.append(region, most)
        weights = np.concatenate([weights, np.zeros((len(missed), POINTS))])
    weights[largest] += exact - found
    return SharedCells(octants.cell[row], octants.octant[row], region.astype(np.uint16), weights)


def _axes_across(seen: NDArray[np.int64]) -> Index:
    """Axis (k,) along which regions change most often between samples (k, 27)."""
    cube = seen.reshape(-1, 3, 3, 3)
    counts = []
    for axis in (3, 2, 1):
        low, high = (np.take(cube, places, axis=axis) for places in ([0, 1], [1, 2]))
        changes = (low != high) & (low >= 0) & (high >= 0)
        counts.append(changes.sum(axis=(1, 2, 3)))
    return np.asarray(np.stack(counts, axis=1).argmax(axis=1))
