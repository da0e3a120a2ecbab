"""Where regions and supports are on the surface of the solid, as the page shows them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Surface
from carillon.composition.entries import RegionEntry, SolidFrame, SupportEntry
from carillon.composition.places import Where
from carillon.errors import UserError
from carillon.fem.geometry.surface import surface_name
from carillon.fem.geometry.walls import WallSize
from carillon.parameters.documents import parameters_from
from solver.response.vertices import inward_normals
from sound.strikes import longest_side, struck_surface
from studio.binary import pack
from studio.rows import Row, is_complete

NONE = 65_535
"""Number of no region and no support."""
BELOW = 1e-4
"""Distance below the surface, in its longest sides, at which a region is looked for."""

Faults = dict[tuple[str, int], str]


class PlacingProcess:
    """What the process for places of regions and supports does, on the surface read last."""

    def __init__(self) -> None:
        self._read: tuple[str, float, WallSize | None, str | None] | None = None
        self._surface: Surface
        self._inward: Array

    def place(
        self,
        mesh: str,
        unit: float,
        rows: Mapping[str, Sequence[Row]],
        wall: WallSize | None,
        up: str | None,
        folder: Path,
        number: int,
    ) -> tuple[bytes, Faults]:
        """See `composition`."""
        if self._read != (mesh, unit, wall, up):
            surface = struck_surface(mesh, unit, wall=wall, up=up)
            self._inward = inward_normals(surface, np.asarray(surface.vertices, dtype=float))
            self._surface, self._read = surface, (mesh, unit, wall, up)
        frame = SolidFrame(mesh, self._surface, surface_name(mesh), unit, folder, up)
        return composition(frame, self._inward, rows, number)


def composition(
    solid: SolidFrame, inward: Array, rows: Mapping[str, Sequence[Row]], number: int
) -> tuple[bytes, Faults]:
    """The message `composition`, and what is wrong with rows of regions and supports.

    Parameters
    ----------
    inward
        Unit normals (V, 3) of the surface's vertices.
    rows
        `regions` and `supports` as a project has them.
    number
        Of the message.
    """
    points, faults = np.asarray(solid.surface.vertices, dtype=float), Faults()
    slight = BELOW * longest_side(solid.surface) * inward
    domains, region = {}, _nowhere(points)
    for index, row in enumerate(rows["regions"]):
        if not is_complete(row):
            continue
        try:
            entry = parameters_from(row, RegionEntry)
            domain = entry.domain(solid)
            region[domain.contains(points + slight)] = index
        except UserError as error:
            faults["regions", index] = str(error)
        else:
            domains[entry.name] = domain
    support = _nowhere(points)
    for index, row in enumerate(rows["supports"]):
        if not is_complete(row):
            continue
        try:
            found = _supported(parameters_from(row, SupportEntry), domains, solid.surface, slight)
            support[found] = index
        except UserError as error:
            faults["supports", index] = str(error)
    header = {"event": "composition", "number": number}
    return pack(header, {"region": ("u2", region), "support": ("u2", support)}), faults


def _nowhere(points: Array) -> NDArray[np.int64]:
    return np.full(len(points), NONE, dtype=np.int64)


def _supported(
    entry: SupportEntry, regions: Mapping[str, Where], surface: Surface, slight: Array
) -> NDArray[np.bool_]:
    """Which vertices (V,) of the surface a support acts on; of one at a point, none."""
    points = np.asarray(surface.vertices, dtype=float)
    domain = entry.support(regions, surface).domain
    if domain is None:
        return np.zeros(len(points), dtype=bool)
    near = [domain.contains(points + side * slight) for side in (0.0, 1.0, -1.0)]
    return np.asarray(np.any(near, axis=0))
