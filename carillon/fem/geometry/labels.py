"""What files say of the parts of a solid: labels of regions, and moduli, at points.

Meshes of volume elements say it of their elements, grids of their boxes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.fem.geometry.label_grids import GRIDS, read_grid
from carillon.fem.geometry.located import LocatedCells, TurnedCells
from carillon.fem.geometry.turning import turned_back
from carillon.fem.geometry.volume_files import READERS, is_volume_file, read_volume_mesh

LABELS = (
    "region",
    "regions",
    "label",
    "labels",
    "material",
    "material_id",
    "gmsh:physical",
    "medit:ref",
    "cell_tags",
    "sets",
    "gmsh:geometrical",
)
"""Names of arrays that hold labels, the first that is there counts; capitals do not matter."""
MODULI = (
    "young",
    "young's modulus [pa]",
    "young's modulus",
    "youngs_modulus",
    "young_modulus",
    "elastic_modulus",
    "modulus",
    "e",
)
"""Names of arrays that hold Young's moduli [Pa], likewise."""
MOST_LARGER = 8.0
"""Longest side of all cells over that of the points, beyond which they are in another unit."""
MOST_OUTSIDE = 0.5
"""Share of the points outside all cells beyond which moduli are of another solid or unit."""
OUTSIDE = -1
"""Label of points that are in no cell."""


@dataclass(frozen=True, eq=False)
class Labels:
    """Labels of the regions of a solid."""

    cells: LocatedCells
    values: NDArray[np.int32]
    """(c,) label of each cell, at least 0."""
    names: dict[int, str]
    """Names of all labels; a number that has none is its own."""

    def at(self, points: Array, nearest: bool = False) -> NDArray[np.int32]:
        """Labels (p,) at `points` (p, 3) [m], -1 outside; with `nearest` that of the nearest cell.

        On a face that cells have in common the first of these counts.
        """
        cells = self.cells.cells_at(points, nearest)
        return np.where(cells < 0, OUTSIDE, self.values[cells]).astype(np.int32)


@dataclass(frozen=True, eq=False)
class CellModuli:
    """Young's moduli of the cells of a mesh or grid."""

    name: str
    """For messages."""

    cells: LocatedCells
    values: Array
    """(c,) [Pa]."""

    def at(self, points: Array) -> Array:
        """Moduli (p,) [Pa] at `points` (p, 3) [m], outside those of the nearest cell.

        Raises UserError if most points are outside, or the cells are far larger than what the
        points are spread over, as where a unit is mistaken.
        """
        cells = self.cells.cells_at(points)
        outside = np.flatnonzero(cells < 0)
        if len(outside) > MOST_OUTSIDE * len(points):
            raise UserError(
                f"{self.name}: {len(outside):,} of {len(points):,} voxels lie outside its cells, "
                "expected moduli all over the solid; see that place and unit are those of the mesh"
            )
        own, longest = self.cells.longest_side, float(np.ptp(points, axis=0).max(initial=0.0))
        if len(points) > 1 and own > MOST_LARGER * longest:
            raise UserError(
                f"{self.name}: its cells measure {own:.4g} m, the voxels {longest:.4g} m, expected "
                "moduli of this solid; see that its unit is that of the mesh"
            )
        cells[outside] = self.cells.cells_at(points[outside], nearest=True)
        return np.asarray(self.values[cells])


def is_cell_file(path: str | Path) -> bool:
    """Whether a name ends as those of files with cells that are read here, arrays left out."""
    return is_volume_file(path) or Path(path).suffix.lower() == ".vti"


def read_labels(
    path: str | Path,
    unit: float = 1.0,
    array: str | None = None,
    box: Array | None = None,
    up: str | None = None,
) -> Labels:
    """The labels in a file: a mesh of volume elements, `.vti`, or `.npy` that fills a box.

    Raises UserError if the file is unusable, see `read_volume_mesh` and `read_grid`, or has no such
    array, or one that holds something else than whole numbers from 0 on.

    Parameters
    ----------
    path, unit, box
        See `carillon.fem.geometry.volume_files.read_volume_mesh` and
        `carillon.fem.geometry.label_grids.read_grid`.
    array
        Name of the array; the first of `LABELS` unless given, and of `.npy` its only one.
    up
        Axis of the file that points up: its cells are turned as the solid is whose `box` this is.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     np.save(f"{folder}/parts.npy", np.array([[[3]], [[5]]]))
    ...     labels = read_labels(f"{folder}/parts.npy", box=np.array([[0, 0, 0], [2, 1, 1]]))
    >>> labels.at(np.array([[0.5, 0.5, 0.5], [1.5, 0.5, 0.5], [2.5, 0.5, 0.5]])).tolist()
    [3, 5, -1]
    """
    cells, data, names = _read(path, unit, box, up)
    values = _chosen(path, data, array, LABELS, "labels")
    whole = np.isfinite(values) & (values == np.floor(values)) if values.dtype.kind == "f" else True
    if not np.all(whole) or (len(values) and not 0 <= values.min() <= values.max() < 2**31):
        raise UserError(
            f"{path}: its labels are not whole numbers of at least 0; number the parts, or name "
            f"another array: {', '.join(data)}"
        )
    labels = values.astype(np.int32)
    there = np.unique(labels).tolist()
    return Labels(cells, labels, {label: names.get(label, str(label)) for label in there})


def read_cell_moduli(
    path: str | Path,
    unit: float = 1.0,
    array: str | None = None,
    box: Array | None = None,
    up: str | None = None,
) -> CellModuli:
    """Young's moduli [Pa] in a file, see `read_labels`; `array`: the first of `MODULI`.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     np.save(f"{folder}/young.npy", np.array([[[1e9]], [[2e9]]]))
    ...     moduli = read_cell_moduli(f"{folder}/young.npy", box=np.array([[0, 0, 0], [2, 1, 1]]))
    >>> moduli.at(np.array([[0.5, 0.5, 0.5], [1.5, 0.5, 0.5]])).tolist()
    [1000000000.0, 2000000000.0]
    """
    cells, data, _ = _read(path, unit, box, up)
    values = _chosen(path, data, array, MODULI, "Young's moduli").astype(float)
    return CellModuli(str(path), cells, values)


def _read(
    path: str | Path, unit: float, box: Array | None, up: str | None
) -> tuple[LocatedCells, Mapping[str, NDArray[Any]], dict[int, str]]:
    if up is not None:
        own = None if box is None else np.sort(turned_back(box, up), axis=0)
        cells, data, names = _read(path, unit, own, None)
        return TurnedCells(cells, up), data, names
    if is_volume_file(path):
        mesh = read_volume_mesh(path, unit)
        return mesh, mesh.data, mesh.names
    if Path(path).suffix.lstrip(".").lower() in GRIDS:
        return *read_grid(path, unit, box), {}
    raise UserError(
        f"{path}: ends in {Path(path).suffix or 'nothing'}, expected a mesh of volume elements or "
        f"a grid: {', '.join((*READERS, *GRIDS))}"
    )


def _chosen(
    path: str | Path,
    data: Mapping[str, NDArray[Any]],
    array: str | None,
    known: tuple[str, ...],
    what: str,
) -> NDArray[Any]:
    lower = {name.lower(): name for name in data}
    wanted = (array.lower(),) if array is not None else known
    name = next((lower[each] for each in wanted if each in lower), None)
    if name is None and array is None and Path(path).suffix.lower() == ".npy":
        (name,) = data
    if name is None:
        expected = repr(array) if array is not None else f"one of {', '.join(known)}"
        raise UserError(
            f"{path}: its cells have {', '.join(data) or 'no arrays'}, expected {what} in "
            f"{expected}"
        )
    if data[name].dtype.kind not in "fiub":
        raise UserError(f"{path}: array {name!r} holds {data[name].dtype}, expected numbers")
    return data[name]
