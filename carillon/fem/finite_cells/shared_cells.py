"""Finite cells whose inside is of several regions: each is integrated over its own part.

A voxel may be of two regions, and be cut by the surface besides, so that regions need not follow
the lattice; see `regions_of_cells`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from carillon.arrays import Array, Index
from carillon.fem.elasticity import DEFAULT_POISSON
from carillon.fem.finite_cells.cells import FLOORS, FiniteCells
from carillon.fem.finite_cells.kinks import Borders, Kinks
from carillon.fem.regions import RegionOf, Regions


@dataclass(frozen=True, eq=False)
class SharedCells:
    """Parts of voxels by region, in cells of several regions; arrays have a row for each part."""

    portion: Index
    """(e,) which of the cells' parts of voxels it is of, see `FiniteCells.cell`."""
    region: RegionOf
    """(e,) whose it is."""
    weights: Array
    """(e, d) integrals of the points' Lagrange polynomials over it, see `FiniteCells`."""
    borders: Borders
    """Where two regions meet in a cell."""


def point_values(
    cells: FiniteCells,
    region: RegionOf,
    shared: SharedCells | None,
    of_voxel: Array,
    of_part: Array | None,
    floor: float,
) -> tuple[Array, RegionOf]:
    """Weighted values (c, s, d) at the points of cells by region, and the regions (c, s).

    `of_voxel` (m,) are the values of voxels, `of_part` (e,) those of shared parts. See
    `FiniteCells.point_values`; a cell of fewer regions has its first one again.
    """
    own = region[cells.voxel].astype(np.int64)
    whole = np.ones(len(own), dtype=bool)
    if shared is not None:
        whole[shared.portion] = False
    law, slot = _slots(cells, own, whole, shared)
    count = law.shape[1]
    chosen = np.flatnonzero(whole)
    value = of_voxel[cells.voxel[chosen]]
    key = cells.cell[chosen] * count + slot
    shape = (law.size, len(cells.weights))
    matrix = sp.csr_matrix((value, (key, cells.row[chosen])), shape)
    values = np.asarray(matrix @ cells.weights)
    volume = np.bincount(key, cells.shares[chosen], minlength=law.size)
    total = np.bincount(key, value * cells.shares[chosen], minlength=law.size)
    if shared is not None:
        assert of_part is not None
        cell = cells.cell[shared.portion]
        key = cell * count + (law[cell] == shared.region[:, None]).argmax(axis=1)
        share = shared.weights.sum(axis=1)
        order = np.arange(len(key))
        parts = sp.csr_matrix((of_part, (key, order)), (law.size, len(key)))
        values += np.asarray(parts @ shared.weights)
        # Not in place: counts of nothing, where all parts are shared, are whole numbers.
        volume = volume + np.bincount(key, share, minlength=law.size)
        total = total + np.bincount(key, of_part * share, minlength=law.size)
    volume, total = volume.reshape(law.shape), total.reshape(law.shape)
    values = values.reshape(*law.shape, -1)
    main = volume.argmax(axis=1)
    mean = total.sum(axis=1) / volume.sum(axis=1)
    values[np.arange(len(law)), main] += floor * mean[:, None] * cells.basis.whole
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
        voxel = cells.voxel[shared.portion]
        of_part = young[voxel] / regions.young[region[voxel]] * regions.young[shared.region]
    return point_values(cells, region, shared, young, of_part, FLOORS[cells.degree][0])


def point_shares(cells: FiniteCells, region: RegionOf, shared: SharedCells | None) -> Array:
    """Weights (c, s, d) of the points by region, see `point_values`."""
    of_part = None if shared is None else np.ones(len(shared.region))
    ones = np.ones(len(region))
    return point_values(cells, region, shared, ones, of_part, FLOORS[cells.degree][1])[0]


def _slots(
    cells: FiniteCells, own: Index, whole: NDArray[np.bool_], shared: SharedCells | None
) -> tuple[RegionOf, Index]:
    """Regions (c, s) of each cell, and the place (w,) of each `whole` part's among them."""
    cell, number = cells.cell[whole].astype(np.int64), own[whole]
    if shared is not None:
        cell = np.append(cell, cells.cell[shared.portion])
        number = np.append(number, shared.region)
    pairs = np.unique(np.stack([cell, number], axis=1), axis=0)
    first = np.searchsorted(pairs[:, 0], np.arange(len(cells)))
    place = np.arange(len(pairs)) - first[pairs[:, 0]]
    law = np.repeat(pairs[first, 1][:, None], int(place.max()) + 1, axis=1)
    law[pairs[:, 0], place] = pairs[:, 1]
    slot = (law[cells.cell[whole]] == own[whole][:, None]).argmax(axis=1)
    return law.astype(np.uint16), slot


def side_moduli(borders: Borders, cell: Index, law: RegionOf, young: Array) -> Array:
    """Moduli, or weights, (k, 2, d) of the two sides of borders, from `young` (k, s, d) by region.

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
    ones = np.ones(cells.mesh.n_cells), np.ones(len(shared.portion))
    volumes, law = point_values(cells, region, shared, *ones, 0.0)
    every, own = np.arange(len(borders)), borders.cell
    inside = side_moduli(borders, every, law[own], volumes[own])
    # Whatever Poisson's ratio is, kinks follow the nodes alike: a search that moves it keeps them.
    alike = regions.with_poisson(DEFAULT_POISSON)
    return replace(Kinks.in_equilibrium(cells.degree, borders, alike, inside), regions=regions)
