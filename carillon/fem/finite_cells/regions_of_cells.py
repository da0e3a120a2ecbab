"""Which regions finite cells are of, and what several of them share.

Lines across a voxel of several regions are divided where the region changes, which is found by
bisection.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Flags, Index
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.kinks import SMALLEST, Borders
from carillon.fem.finite_cells.region_lines import (
    InsideAt,
    OctantParts,
    Octants,
    RegionsAt,
    parts_of_octants,
)
from carillon.fem.finite_cells.shapes import POINTS, octant_weights, point_mass, points
from carillon.fem.finite_cells.shared_cells import SharedCells, point_values
from carillon.fem.regions import RegionOf

SAMPLES = (0.02, 0.5, 0.98)
"""Places along a voxel's edge at which regions are looked for."""
ROUNDING = 1e-12
"""Share of a whole cell's energy that a part's may be negative by."""
FLAT = 1e-6
"""Least extent of the points of a border across each other, in cells, for a plane through them."""


def regions_of_cells(
    cells: FiniteCells, regions_at: RegionsAt, inside: InsideAt
) -> tuple[RegionOf, SharedCells, Flags]:
    """Region (m,) that most of each voxel is of, what several share, and which (m,) are of none.

    `inside` tells whether points (p, 3) [m] are inside the solid's surface.
    """
    cell, octant = np.nonzero(cells.voxels >= 0)
    octants = Octants(cells, cell, octant)
    seen = _seen(octants, regions_at, inside)
    region = seen.max(axis=1)
    split = np.flatnonzero(_varies(seen))
    parts = OctantParts.nothing()
    if len(split):
        some = octants.some(split)
        parts = _complete(
            parts_of_octants(some, _axes_across(seen[split]), regions_at, inside),
            some.weights,
            seen[split],
        )
        volume = np.zeros((len(split), int(seen.max()) + 1))
        np.add.at(volume, (parts.octant, parts.region), parts.weights.sum(axis=1))
        region[split] = volume.argmax(axis=1)
    # A voxel's octants, of a divided cell, are all in it: the largest decides.
    order = np.argsort(cells.fractions[cell, octant], kind="stable")
    of_voxel = np.full(cells.mesh.n_cells, -1)
    of_voxel[cells.voxels[cell, octant][order]] = region[order]
    nowhere = of_voxel < 0
    found = np.maximum(of_voxel, 0).astype(np.uint16)
    shared = SharedCells(
        cell[split][parts.octant],
        octant[split][parts.octant],
        parts.region.astype(np.uint16),
        parts.weights,
        Borders.nothing(),
    )
    border_cell = cell[split][parts.border_octant]
    return found, _with_borders(cells, found, shared, border_cell, parts.border), nowhere


def _seen(octants: Octants, regions_at: RegionsAt, inside: InsideAt) -> NDArray[np.int64]:
    """Regions (k, 27) at samples of octants; -1 where there is none, or outside the solid."""
    offsets = np.array([[x, y, z] for z in SAMPLES for y in SAMPLES for x in SAMPLES])
    seen = octants.sampled(offsets, regions_at)
    cut = np.flatnonzero(octants.is_cut)
    mixed = cut[_varies(seen[cut])]
    if len(mixed):
        is_inside = octants.some(mixed).sampled(offsets, inside).astype(bool)
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


def _complete(parts: OctantParts, exact: Array, seen: NDArray[np.int64]) -> OctantParts:
    """The parts with what lines miss of the weights (k, 125) of octants, in proportion to them.

    That is what octants have taken in from slight neighbours, and rounding. Octants that lines find
    nothing of are of the commonest sample's region.
    """
    row, region, weights = parts.octant, parts.region, parts.weights
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
    return OctantParts(row, region, weights, parts.border_octant, parts.border)


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
    shared = _made_definite(cells, region, shared)
    ones = np.ones(cells.mesh.n_cells), np.ones(len(shared.cell))
    inside, law = point_values(cells, region, shared, *ones)
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
    middles = weights @ points() / both[:, :, None]
    across = middles[:, 1] - middles[:, 0]
    normal = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    place = np.full((len(own), 3), 0.5)
    _fit_planes(cells, own, cell, border, place, normal)
    borders = Borders(
        own,
        np.take_along_axis(law[own], slots, axis=1),
        place,
        normal,
        both / both.sum(axis=1, keepdims=True),
    )
    return SharedCells(shared.cell, shared.octant, shared.region, shared.weights, borders)


def _made_definite(cells: FiniteCells, region: RegionOf, shared: SharedCells) -> SharedCells:
    """What cells share, with as little of the whole cell moved as makes energies positive.

    What lines miss of an octant is in its largest part, and may be negative somewhere.
    """
    own, first = np.unique(shared.cell, return_index=True)
    if not len(own):
        return shared
    ones = np.ones(cells.mesh.n_cells), np.ones(len(shared.cell))
    inside, law = point_values(cells, region, shared, *ones)
    products = point_mass()
    whole = (octant_weights().sum(axis=0) @ products).reshape(27, 27)
    inverse = np.linalg.inv(np.linalg.cholesky(whole))
    grams = (inside[own].reshape(-1, POINTS) @ products).reshape(-1, 27, 27)
    least = np.linalg.eigvalsh(inverse @ grams @ inverse.T)[:, 0].reshape(len(own), -1)
    row, slot = np.nonzero(least < -ROUNDING)
    lacks = -least[row, slot]
    # Moved from the part that has most to spare, so that all together stays what it is.
    spare = least.argmax(axis=1)[row]
    can = least[row, spare] > lacks
    numbers = shared.region.copy()
    for number in np.flatnonzero(~can):
        # A sliver that no other part can mend is of that part.
        cell = own[row[number]]
        sliver = (shared.cell == cell) & (shared.region == law[cell, slot[number]])
        numbers[sliver] = law[cell, spare[number]]
    row, slot, spare, lacks = row[can], slot[can], spare[can], lacks[can]
    cell = np.tile(own[row], 2)
    share = np.append(lacks, -lacks)
    return SharedCells(
        np.append(shared.cell, cell),
        np.append(shared.octant, np.tile(shared.octant[first][row], 2)),
        np.concatenate([numbers, law[own[row], slot], law[own[row], spare]]),
        np.concatenate([shared.weights, share[:, None] * octant_weights().sum(axis=0)]),
        shared.borders,
    )


def _fit_planes(
    cells: FiniteCells, own: Index, cell: Index, border: Array, place: Array, normal: Array
) -> None:
    """Put planes through the points of borders, where there are enough of them."""
    order = np.argsort(cell, kind="stable")
    cell, border = cell[order], border[order]
    edge = cells.mesh.edge * cells.span[cell]
    corner = cells.mesh.origin + cells.mesh.edge * cells.grid[cell]
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
