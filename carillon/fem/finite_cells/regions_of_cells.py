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
from carillon.fem.finite_cells.slabs import Slabs, straight_bodies
from carillon.fem.regions import RegionOf

SAMPLES = (0.02, 0.5, 0.98)
"""Places along a box's edge at which regions are looked for."""
SAMPLED = np.array([[x, y, z] for z in SAMPLES for y in SAMPLES for x in SAMPLES])
"""(27, 3) in a box."""
THIN = 0.5
"""Edges of a voxel below which what it holds is thin: samples, and lines that run along it, would
miss it."""
ROUNDING = 1e-12
"""Share of a whole cell's energy, times the part's volume, that a part's may be negative by."""
PARTS_AT_ONCE = 1024
"""Parts whose energies are computed together: 20 MB."""
FLAT = 1e-6
"""Least extent of the points of a border across each other, in cells, for a plane through them."""


def regions_of_cells(
    cells: FiniteCells, regions_at: RegionsAt, inside: InsideAt, materials: Index
) -> tuple[RegionOf, SharedCells, Flags]:
    """Region (m,) that most of each voxel is of, what several share, and which (m,) are of none.

    `inside` tells whether points (p, 3) [m] are inside the solid's surface, `materials` (r,) which
    regions are of one material: their numbers are the same.
    """
    boxes = Boxes(cells, np.arange(len(cells.cell)))
    seen = _seen(boxes, regions_at, inside)
    bodies = straight_bodies(cells)
    thickness = np.linalg.norm(bodies[1], axis=1).min(axis=1)
    thin = thickness < THIN * cells.edges[cells.cell] * boxes.local[1]
    slabs = Slabs(cells, np.arange(len(cells.cell)), bodies)
    seen[thin] = slabs.some(np.flatnonzero(thin)).sampled(SAMPLED, regions_at)
    region = seen.max(axis=1)
    split = np.flatnonzero(_varies(seen))
    parts = BoxParts.nothing(cells.basis.n_points)
    if len(split):
        found = BoxParts.joined(
            [
                _parts_of(kind, split, chosen, seen, regions_at, inside)
                for kind, chosen in ((boxes, ~thin[split]), (slabs, thin[split]))
            ]
        )
        exact = boxes.some(split).weights
        parts = _complete(cells, found, exact, seen[split], materials)
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
    seen = boxes.sampled(SAMPLED, regions_at)
    cut = np.flatnonzero(boxes.is_cut)
    mixed = cut[_varies(seen[cut])]
    if len(mixed):
        is_inside = boxes.some(mixed).sampled(SAMPLED, inside).astype(bool)
        left = np.where(is_inside, seen[mixed], -1)
        # Too thin for the samples: all of them count.
        seen[mixed] = np.where((left < 0).all(axis=1, keepdims=True), seen[mixed], left)
    return seen


def _parts_of(
    boxes: Boxes,
    split: Index,
    chosen: Flags,
    seen: NDArray[np.int64],
    regions_at: RegionsAt,
    inside: InsideAt,
) -> BoxParts:
    """Parts by region of those `chosen` (k,) of the boxes `split` (k,); see `_seen`."""
    rows = np.flatnonzero(chosen)
    if not len(rows):
        return BoxParts.nothing(boxes.cells.basis.n_points)
    own = split[rows]
    parts = parts_of_boxes(boxes.some(own), _axes_across(seen[own]), regions_at, inside)
    return replace(parts, box=rows[parts.box], border_box=rows[parts.border_box])


def _varies(seen: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether samples (k, p) are of several regions, those of none aside."""
    most = seen.max(axis=1)
    return np.asarray((np.where(seen < 0, most[:, None], seen) != most[:, None]).any(axis=1))


def _most(row: NDArray[np.int64]) -> int:
    """The region that most samples (p,) are of; -1 if there is none."""
    there = row[row >= 0]
    return int(np.bincount(there).argmax()) if len(there) else -1


def _complete(
    cells: FiniteCells, parts: BoxParts, exact: Array, seen: NDArray[np.int64], materials: Index
) -> BoxParts:
    """The parts with what lines miss of the weights (k, d) of boxes, in proportion to them.

    That is what boxes have taken in from slight neighbours, and rounding. Where a part would have
    negative energy somewhere, and another is of another material, those of the box are as lines
    find them, with the box's volume. Boxes that lines find nothing of are of the commonest sample's
    region.
    """
    row, region, found = parts.box, parts.region, parts.weights
    summed = np.zeros_like(exact)
    np.add.at(summed, row, found)
    total = np.bincount(row, found.sum(axis=1), minlength=len(exact))
    share = found.sum(axis=1) / np.where(total > 0.0, total, 1.0)[row]
    weights = found + share[:, None] * (exact - summed)[row]
    negative = np.zeros(len(exact), dtype=bool)
    negative[row[_least_energies(cells, weights) < -ROUNDING]] = True
    least, most = np.full(len(exact), len(materials)), np.zeros(len(exact), dtype=np.int64)
    np.minimum.at(least, row, materials[region])
    np.maximum.at(most, row, materials[region])
    negative &= least < most
    scale = exact.sum(axis=1) / np.where(total > 0.0, total, 1.0)
    weights = np.where(negative[row, None], scale[row, None] * found, weights)
    missed = np.flatnonzero(total == 0.0)
    if len(missed):  # slivers between the lines
        commonest = [_most(samples) for samples in seen[missed]]
        row, region = np.append(row, missed), np.append(region, commonest)
        weights = np.concatenate([weights, exact[missed]])
    return BoxParts(row, region, weights, parts.border_box, parts.border)


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
