"""Regions of a solid with their materials and places, in any discretisation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Index
from carillon.composition.places import ClosedSurface, Everywhere, Placement, Where
from carillon.errors import UserError
from carillon.fem.finite_cells.cells import FiniteCells, middles_of_voxels
from carillon.fem.finite_cells.regions_of_cells import regions_of_cells
from carillon.fem.finite_cells.shared_cells import SharedCells
from carillon.fem.geometry import HexMesh
from carillon.fem.regions import MOST, RegionOf, Regions

DIRECTION_STEP = 1.0 / 40.0
"""Step to which components of axes are rounded where axes vary over the solid: about a degree."""
REACH = 2.0
"""Largest distance, in voxels, from which a voxel outside the surface takes the nearest region."""

AxesAt = Callable[[Array], Array]
"""Axes (p, 3, 3), in columns, of a material at points (p, 3) [m]."""


@dataclass(frozen=True, eq=False)
class MaterialRegion:
    """Part of a solid, and what it is made of."""

    material: Regions
    """Its row, of a material whose axes are x, y, z."""
    place: Where
    axes: Array | AxesAt | None = None
    """(3, 3) axes of the material, in columns, or those at points; None if they are x, y, z."""

    @property
    def name(self) -> str:
        """Name of the region."""
        return self.material.names[0]


@dataclass(frozen=True)
class PlacedRegions:
    """Regions as the cells of a mesh have them."""

    regions: Regions
    region: RegionOf | None = None
    """(m,) of each cell, or voxel; None if there is one."""
    shared: SharedCells | None = None
    """Parts of finite cells that several regions share."""


class Composition:
    """The regions of a solid, of which later ones lie over earlier ones.

    Parameters
    ----------
    parts
        Regions in their order.
    name
        Of the solid, for messages.
    surface
        Inside of the solid, by which finite cells are divided.
    rest
        Whether the first part is what the others leave, which may be nothing.
    """

    def __init__(
        self,
        parts: Sequence[MaterialRegion],
        name: str,
        surface: ClosedSurface,
        rest: bool = False,
    ) -> None:
        if not parts:
            raise UserError(f"{name}: no region; expected at least one")
        self._parts, self._name, self._surface = tuple(parts), name, surface
        self._rest = rest
        self.placement = Placement([part.place for part in parts])
        """Which part a place is of."""
        self.regions = Regions.together([_turned(part) for part in parts])
        """A row for each region, those aside whose axes vary."""

    @property
    def _is_one(self) -> bool:
        first = self._parts[0]
        alike = isinstance(first.place, Everywhere) and not callable(first.axes)
        return len(self._parts) == 1 and alike

    def parts_at(self, points: Array) -> Index:
        """Number (p,) of the part that each of some points (p, 3) [m] of the solid is of.

        One that is of none has that of the nearest one.
        """
        found = self.placement.at(points).astype(np.int64)
        lost, there = np.flatnonzero(found < 0), np.flatnonzero(found >= 0)
        if len(lost) and len(there):
            from scipy.spatial import cKDTree  # Its import takes long.

            found[lost] = found[there[cKDTree(points[there]).query(points[lost])[1]]]
        return np.maximum(found, 0)

    def of_voxels(self, mesh: HexMesh) -> PlacedRegions:
        """Regions of the voxels of a mesh: those at their middles.

        Raises UserError if some voxels are of no region, or some region has no voxel.
        """
        span = 1.0 if mesh.span is None else mesh.span[:, None]
        middles = mesh.origin + mesh.edge * (mesh.grid + 0.5 * span)
        found = self._without_holes(self.placement.at(middles), middles, mesh.edge)
        self._require_all(found)
        return self._placed(found, middles)

    def of_cells(self, cells: FiniteCells, complete: bool = True) -> PlacedRegions:
        """Regions of the voxels of finite cells, and what several of them share.

        Raises UserError if some voxels are of no region, or, if `complete`, some region has none.
        """
        if self._is_one:
            return PlacedRegions(self.regions)
        materials, inside = self._materials(), self._surface.contains
        region, shared, nowhere = regions_of_cells(cells, self.placement.at, inside, materials)
        middles, _ = middles_of_voxels(cells)
        found = np.where(nowhere, -1, region.astype(np.int64))
        found = self._without_holes(found, middles, cells.mesh.edge)
        if complete:
            self._require_all(np.append(found, shared.region))
        return self._placed(found, middles, shared, cells)

    def _placed(
        self,
        found: NDArray[np.integer],
        middles: Array,
        shared: SharedCells | None = None,
        cells: FiniteCells | None = None,
    ) -> PlacedRegions:
        """Regions with a row for each direction of axes that vary."""
        places, number = middles, found
        if shared is not None and cells is not None:
            voxel = cells.voxel[shared.portion]
            places = np.concatenate([middles, middles[voxel]])
            number = np.concatenate([found, shared.region])
        regions, number, base = self._turned_by_place(number.astype(np.int64), places)
        if len(regions) > MOST:
            raise UserError(f"{len(regions):,} directions of axes; expected {MOST:,} at most")
        region = number[: len(found)].astype(np.uint16)
        if len(regions) == 1:
            return PlacedRegions(regions)
        if shared is not None:
            numbers = number[len(found) :].astype(np.uint16)
            # Kinks are of two regions; where axes vary, rows of the table are no regions.
            sides = base[shared.borders.region.astype(np.int64)]
            borders = shared.borders.some((sides >= 0).all(axis=1), sides)
            shared = replace(shared, region=numbers, borders=borders)
        return PlacedRegions(regions, region, shared)

    def _materials(self) -> Index:
        """Number (r,) of each region's material: that of the first region of the same one."""
        known: dict[tuple[object, ...], int] = {}
        numbers = []
        for index, part in enumerate(self._parts):
            row = _turned(part)
            key: tuple[object, ...] = (index,)
            if not callable(part.axes):
                key = row.elasticity[0].tobytes(), float(row.young[0]), float(row.density[0])
            numbers.append(known.setdefault(key, index))
        return np.array(numbers)

    def _turned_by_place(self, number: Index, places: Array) -> tuple[Regions, Index, Index]:
        """The table, the row (p,) of each place, and that of each part, -1 where axes vary."""
        rows = [_turned(part) for part in self._parts]
        result = number.copy()
        for index, part in enumerate(self._parts):
            if not callable(part.axes):
                continue
            own = np.flatnonzero(number == index)
            axes, which = _directions(part.axes(places[own]), part.name)
            first = sum(map(len, rows))
            rows.append(Regions.together([_with_axes(part.material, each) for each in axes]))
            result[own] = first + which
        # Rows of regions whose axes vary serve no place.
        table = Regions.together(rows)
        used, result = np.unique(result, return_inverse=True)
        alike = [index for index, part in enumerate(self._parts) if not callable(part.axes)]
        kept = np.union1d(used, alike).astype(np.int64)
        base = np.full(len(self._parts), -1)
        base[alike] = np.searchsorted(kept, alike)
        return table.rows(kept), np.searchsorted(kept, used)[result.ravel()], base

    def _without_holes(
        self, found: NDArray[np.integer], middles: Array, edge: float
    ) -> NDArray[np.integer]:
        """Regions of all places; those without that lie outside the surface have the nearest's."""
        holes = np.flatnonzero(found < 0)
        if not len(holes):
            return found
        there = np.flatnonzero(found >= 0)
        inside = self._surface.contains(middles[holes])
        if len(there) and not inside.any():
            from scipy.spatial import cKDTree  # Its import takes long.

            distance, nearest = cKDTree(middles[there]).query(middles[holes])
            far = distance > REACH * edge
            found = found.copy()
            found[holes[~far]] = found[there[nearest[~far]]]
            holes = holes[far]
        if len(holes):
            point = ", ".join(f"{value:.3g}" for value in middles[holes[0]])
            raise UserError(
                f"{self._name}: {len(holes):,} of {len(found):,} voxels are of no region, the "
                f"first at ({point}) m; enlarge a region, or begin with one without `where`"
            )
        return found

    def _require_all(self, found: NDArray[np.integer]) -> None:
        missing = [
            part.name
            for index, part in enumerate(self._parts)
            if not (found == index).any() and not (self._rest and index == 0)
        ]
        if missing:
            raise UserError(
                f"{self._name}: region {missing[0]!r} has no voxel of the solid; later regions "
                "cover it, or it lies elsewhere, or is too small for the resolution"
            )


def _with_axes(material: Regions, axes: Array) -> Regions:
    return replace(material, laws=tuple(law.rotated(axes) for law in material.laws))


def _turned(part: MaterialRegion) -> Regions:
    if part.axes is None or callable(part.axes):
        return part.material
    return _with_axes(part.material, part.axes)


def _directions(axes: Array, name: str) -> tuple[Array, Index]:
    """Distinct axes (d, 3, 3), rounded, and which of them (p,) each place has."""
    given = np.asarray(axes, dtype=float)
    if given.ndim != 3 or given.shape[1:] != (3, 3) or not np.isfinite(given).all():
        raise UserError(f"region {name!r}: axes of shape {given.shape}, expected (points, 3, 3)")
    # A plane of symmetry has no front.
    signs = np.sign(np.take_along_axis(given, np.abs(given).argmax(axis=1)[:, None], axis=1))
    rounded = np.rint(given * signs / DIRECTION_STEP)[:, :, :2]
    distinct, which = np.unique(rounded.reshape(-1, 6), axis=0, return_inverse=True)
    first, second = distinct.reshape(-1, 3, 2)[:, :, 0], distinct.reshape(-1, 3, 2)[:, :, 1]
    first = first / np.linalg.norm(first, axis=1, keepdims=True)
    second = second - (first * second).sum(axis=1, keepdims=True) * first
    second = second / np.linalg.norm(second, axis=1, keepdims=True)
    turned = np.stack([first, second, np.cross(first, second)], axis=2)
    return turned, which.ravel()


def axes_about(grain: Array, pith: Array) -> AxesAt:
    """Axes of wood at points: along the `grain` (3,), away from the pith, and around it.

    The pith is the line along the grain through the point `pith` (3,) [m].
    """

    def at(points: Array) -> Array:
        along = grain / np.linalg.norm(grain)
        away = points - pith
        away = away - (away @ along)[:, None] * along
        length = np.linalg.norm(away, axis=1, keepdims=True)
        other = np.eye(3)[np.abs(along).argmin()]
        other = other - (other @ along) * along
        radial = np.where(length > 0.0, away / np.maximum(length, 1e-300), other)
        radial = radial / np.linalg.norm(radial, axis=1, keepdims=True)
        first = np.broadcast_to(along, points.shape)
        return np.stack([first, radial, np.cross(first, radial)], axis=2)

    return at
