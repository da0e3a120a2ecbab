"""Finite cells whose inside is of several regions: each is integrated over its own part.

A voxel may be of two regions, and be cut by the surface besides, so that regions need not follow
the lattice; see `regions_of_cells`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Index
from carillon.fem.elasticity import DEFAULT_POISSON
from carillon.fem.finite_cells.cells import FLOOR, FiniteCells
from carillon.fem.finite_cells.kinks import Borders, Kinks
from carillon.fem.finite_cells.shapes import OCTANTS, POINTS, octant_weights
from carillon.fem.regions import RegionOf, Regions


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
    borders: Borders
    """Where two regions meet in a cell."""


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


def side_moduli(borders: Borders, cell: Index, law: RegionOf, young: Array) -> Array:
    """Those (k, 2, 125) of `young` (k, s, 125) that belong to the two sides of borders.

    `law` (k, s) are the regions of cells, `cell` (k,) the numbers of their borders.
    """
    slot = (law[:, None] == borders.region[cell][:, :, None]).argmax(axis=2)
    return np.take_along_axis(young, slot[:, :, None], axis=1)


def kinks_of(
    cells: FiniteCells, regions: Regions, region: RegionOf, shared: SharedCells
) -> Kinks | None:
    """Kinks of cells at borders, by the materials as they are in tables; None if there are none."""
    borders = shared.borders
    if not len(borders):
        return None
    every = np.arange(len(borders))
    tables = point_moduli(cells, regions, region, shared, regions.young[region])
    ones = np.ones(cells.mesh.n_cells), np.ones(len(shared.cell))
    volumes, law = point_values(cells, region, shared, *ones)
    moduli, inside = (
        side_moduli(borders, every, law[borders.cell], values[borders.cell])
        for values in (tables[0], volumes)
    )
    # Whatever Poisson's ratio is, kinks follow the nodes alike: a search that moves it keeps them.
    alike = regions.with_poisson(DEFAULT_POISSON)
    return replace(Kinks.in_equilibrium(borders, alike, moduli, inside), regions=regions)
