"""Which regions finite cells are of, and what several of them share.

Lines across a voxel of several regions are divided where the region changes, which is found by
bisection.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.kinks import SMALLEST, Borders
from carillon.fem.finite_cells.matrices import nodal_mass
from carillon.fem.finite_cells.region_lines import (
    Boxes,
    BoxParts,
    InsideAt,
    RegionsAt,
    parts_of_boxes,
)
from carillon.fem.finite_cells.shared_cells import SharedCells, point_values
from carillon.fem.regions import RegionOf

SAMPLES = (0.02, 0.5, 0.98)
"""Places along a box's edge at which regions are looked for."""
ROUNDING = 1e-12
"""Share of a whole cell's energy, times the part's volume, that a part's may be negative by."""
LEAST_MIXED = 4.0**-12
"""Least share of a voxel's regions that is mixed where a part's energy is negative."""
PARTS_AT_ONCE = 1024
"""Parts whose energies are computed together: 20 MB."""
FLAT = 1e-6
"""Least extent of the points of a border across each other, in cells, for a plane through them."""


def regions_of_cells(
    cells: FiniteCells, regions_at: RegionsAt, inside: InsideAt
) -> tuple[RegionOf, SharedCells, Flags]:
    """Region (m,) that most of each voxel is of, what several share, and which (m,) are of none.

    `inside` tells whether points (p, 3) [m] are inside the solid's surface.
    """
    boxes = Boxes(cells, np.arange(len(cells.cell)))
    seen = _seen(boxes, regions_at, inside)
    region = seen.max(axis=1)
    split = np.flatnonzero(_varies(seen))
    parts = BoxParts.nothing(cells.basis.n_points)
    if len(split):
        some = boxes.some(split)
        axes = _axes_across(seen[split])
        found = parts_of_boxes(some, axes, regions_at, inside)
        exact = some.weights
        parts = _made_definite(cells, _complete(found, exact, seen[split]), exact)
    # A voxel is of the region that most of it is of, in all cells that have some of it.
    whole = np.ones(len(region), dtype=bool)
    whole[split] = False
    whole &= region >= 0
    cube = cells.edges[cells.cell] ** 3
    portion = np.append(np.flatnonzero(whole), split[parts.box])
    share = np.append(cells.shares[whole], parts.weights.sum(axis=1)) * cube[portion]
    number = np.append(region[whole], parts.region)
    volume = np.zeros((cells.mesh.n_cells, int(seen.max(initial=0)) + 1))
    np.add.at(volume, (cells.voxel[portion], number), share)
    found_regions = volume.argmax(axis=1).astype(np.uint16)
    nowhere = ~volume.any(axis=1)
    # What is all of one region, but not of its voxel's, is a part, too.
    other = np.flatnonzero(whole & (region != found_regions[cells.voxel]))
    shared = SharedCells(
        np.append(split[parts.box], other),
        np.append(parts.region, region[other]).astype(np.uint16),
        np.concatenate([parts.weights, cells.weights[cells.row[other]]]),
        Borders.nothing(),
    )
    border_cell = cells.cell[split[parts.border_box]].astype(np.int64)
    return (
        found_regions,
        _with_borders(cells, found_regions, shared, border_cell, parts.border),
        nowhere,
    )


def _seen(boxes: Boxes, regions_at: RegionsAt, inside: InsideAt) -> NDArray[np.int64]:
    """Regions (k, 27) at samples of boxes; -1 where there is none, or outside the solid."""
    offsets = np.array([[x, y, z] for z in SAMPLES for y in SAMPLES for x in SAMPLES])
    seen = boxes.sampled(offsets, regions_at)
    cut = np.flatnonzero(boxes.is_cut)
    mixed = cut[_varies(seen[cut])]
    if len(mixed):
        is_inside = boxes.some(mixed).sampled(offsets, inside).astype(bool)
        left = np.where(is_inside, seen[mixed], -1)
        # Too thin for the samples: all of them count.
        seen[mixed] = np.where((left < 0).all(axis=1, keepdims=True), seen[mixed], left)
    return seen


def _varies(seen: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether samples (k, p) are of several regions, those of none aside."""
    most = seen.max(axis=1)
    return np.asarray((np.where(seen < 0, most[:, None], seen) != most[:, None]).any(axis=1))


def _most(row: NDArray[np.int64]) -> int:
    """The region that most samples (p,) are of; -1 if there is none."""
    there = row[row >= 0]
    return int(np.bincount(there).argmax()) if len(there) else -1


def _complete(parts: BoxParts, exact: Array, seen: NDArray[np.int64]) -> BoxParts:
    """The parts with what lines miss of the weights (k, d) of boxes, in proportion to them.

    That is what boxes have taken in from slight neighbours, and rounding. Boxes that lines find
    nothing of are of the commonest sample's region.
    """
    row, region, weights = parts.box, parts.region, parts.weights
    found = np.zeros_like(exact)
    np.add.at(found, row, weights)
    total = np.bincount(row, weights.sum(axis=1), minlength=len(exact))
    share = weights.sum(axis=1) / np.where(total > 0.0, total, 1.0)[row]
    weights = weights + share[:, None] * (exact - found)[row]
    missed = np.flatnonzero(total == 0.0)
    if len(missed):  # slivers between the lines
        most = [_most(samples) for samples in seen[missed]]
        row, region = np.append(row, missed), np.append(region, most)
        weights = np.concatenate([weights, exact[missed]])
    return BoxParts(row, region, weights, parts.border_box, parts.border)


def _axes_across(seen: NDArray[np.int64]) -> Index:
    """Axis (k,) along which regions change most often between samples (k, 27)."""
    cube = seen.reshape(-1, 3, 3, 3)
    counts = []
    for axis in (3, 2, 1):
        low, high = (np.take(cube, places, axis=axis) for places in ([0, 1], [1, 2]))
        changes = (low != high) & (low >= 0) & (high >= 0)
        counts.append(changes.sum(axis=(1, 2, 3)))
    return np.asarray(np.stack(counts, axis=1).argmax(axis=1))


def _with_borders(
    cells: FiniteCells, region: RegionOf, shared: SharedCells, cell: Index, border: Array
) -> SharedCells:
    """What cells share, with the planes between the two regions of those that have two.

    `border` (b, 3) [m] are points of borders in cells (b,).
    """
    ones = np.ones(cells.mesh.n_cells), np.ones(len(shared.portion))
    inside, law = point_values(cells, region, shared, *ones, 0.0)
    if law.shape[1] < 2:
        return shared
    volume = inside.sum(axis=2)
    volume[:, 1:][law[:, 1:] == law[:, :1]] = 0.0  # a cell of fewer regions repeats its first one
    there = volume > SMALLEST * volume.sum(axis=1, keepdims=True)
    own = np.flatnonzero(there.sum(axis=1) == 2)
    if not len(own):
        return shared
    slots = np.argsort(~there[own], axis=1, kind="stable")[:, :2]
    both = np.take_along_axis(volume[own], slots, axis=1)
    weights = np.take_along_axis(inside[own], slots[:, :, None], axis=1)
    middles = weights @ cells.basis.points / both[:, :, None]
    across = middles[:, 1] - middles[:, 0]
    length = np.linalg.norm(across, axis=1)
    apart = length > FLAT  # of which neither is all around the other
    own, slots, both, across = own[apart], slots[apart], both[apart], across[apart]
    normal = across / length[apart, None]
    place = np.full((len(own), 3), 0.5)
    _fit_planes(cells, own, cell, border, place, normal)
    borders = Borders(
        own,
        np.take_along_axis(law[own], slots, axis=1),
        place,
        normal,
        both / both.sum(axis=1, keepdims=True),
    )
    return SharedCells(shared.portion, shared.region, shared.weights, borders)


def _made_definite(cells: FiniteCells, parts: BoxParts, exact: Array) -> BoxParts:
    """The parts, those of a box mixed by as little as makes the energy of each positive.

    What lines miss of a box is in its parts by their volumes, and may be negative somewhere. Mixing
    leaves each part its volume, and all together the weights `exact` (k, d) of boxes.
    """
    volume = parts.weights.sum(axis=1) / exact.sum(axis=1)[parts.box]
    mixed = volume[:, None] * exact[parts.box] - parts.weights
    weights = parts.weights.copy()
    left, share = np.arange(len(weights)), LEAST_MIXED
    while share <= 1.0:
        negative = left[_least_energies(cells, weights[left]) < -ROUNDING]
        if not len(negative):
            break
        # All parts of a box together.
        left = np.flatnonzero(np.isin(parts.box, parts.box[negative]))
        weights[left] = parts.weights[left] + share * mixed[left]
        share *= 4.0
    return replace(parts, weights=weights)


def _least_energies(cells: FiniteCells, weights: Array) -> Array:
    """Least eigenvalue (e,) of the mass of each part with weights (e, d), by a whole cell's, over
    the part's volume."""
    degree, found = cells.degree, np.empty(len(weights))
    inverse = np.linalg.inv(np.linalg.cholesky(nodal_mass(degree, cells.basis.whole[None])[0]))
    for first in range(0, len(weights), PARTS_AT_ONCE):
        few = slice(first, first + PARTS_AT_ONCE)
        grams = inverse @ nodal_mass(degree, weights[few]) @ inverse.T
        found[few] = np.linalg.eigvalsh(grams)[:, 0] / weights[few].sum(axis=1)
    return found


def _fit_planes(
    cells: FiniteCells, own: Index, cell: Index, border: Array, place: Array, normal: Array
) -> None:
    """Put planes through the points of borders, where there are enough of them."""
    order = np.argsort(cell, kind="stable")
    cell, border = cell[order], border[order]
    edge = cells.edges[cell]
    corner = cells.origin + cells.step * cells.corner[cell]
    local = (border - corner) / edge[:, None]
    first = np.searchsorted(cell, own)
    last = np.searchsorted(cell, own, side="right")
    for row in np.flatnonzero(last - first >= 3):
        some = local[first[row] : last[row]]
        middle = some.mean(axis=0)
        _, extents, axes = np.linalg.svd(some - middle, full_matrices=False)
        place[row] = middle
        if extents[1] > FLAT:
            normal[row] = axes[2] if axes[2] @ normal[row] >= 0.0 else -axes[2]
