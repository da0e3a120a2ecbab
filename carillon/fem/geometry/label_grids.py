"""Labels and moduli on grids of boxes: arrays of numpy, and images of VTK (.vti)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Index
from carillon.errors import UserError
from carillon.fem.geometry.located import LocatedCells
from carillon.files.paths import first_line, require_file
from carillon.files.vtk_xml import VtkFile
from carillon.limits import MESH_BYTES

GRIDS = ("npy", "vti")
"""Endings of files of grids."""
_BESIDE = 1e-9
"""Part of a box by which a point may be outside the grid and still on its face."""


@dataclass(frozen=True, eq=False)
class BoxGrid(LocatedCells):
    """Equal boxes beside each other, numbered x fastest."""

    origin: Array
    """(3,) corner of the first box [m]."""
    spacing: Array
    """(3,) sides of a box [m]."""
    shape: tuple[int, int, int]
    axes: Array
    """(3, 3) whose columns are unit vectors along the grid's axes."""

    @property
    def n_cells(self) -> int:
        return math.prod(self.shape)

    @property
    def longest_side(self) -> float:
        return float((self.spacing * self.shape).max())

    def cells_at(self, points: Array, nearest: bool = False) -> Index:
        place = (np.asarray(points, dtype=float) - self.origin) @ self.axes / self.spacing
        sizes = np.array(self.shape)
        number = np.clip(np.floor(place).astype(np.int64), 0, sizes - 1)
        cells = number @ np.array([1, sizes[0], sizes[0] * sizes[1]])
        if nearest:
            return np.asarray(cells)
        outside = (place < -_BESIDE) | (place > sizes + _BESIDE)
        return np.asarray(np.where(outside.any(axis=1), -1, cells))


def read_grid(
    path: str | Path,
    unit: float = 1.0,
    box: Array | None = None,
) -> tuple[BoxGrid, dict[str, NDArray[Any]]]:
    """A grid, and values (c,) of its boxes by name.

    Raises UserError if the file is missing, unreadable, or holds something else than numbers.

    Parameters
    ----------
    path
        `.npy` with (nx, ny, nz) numbers, or `.vti`, with its origin, spacing and direction.
        Values at points of an image are those of boxes around them.
    unit
        Metres per unit of an image's coordinates.
    box
        Lowest and highest corner (2, 3) [m] that the boxes of an array fill; needed of `.npy`.
    """
    path = require_file(path, f"a grid ({', '.join(GRIDS)})")
    size = path.stat().st_size
    if size > MESH_BYTES:
        raise UserError(
            f"{path}: {size:,} bytes, expected at most {MESH_BYTES:,}; coarsen the grid"
        )
    try:
        if path.suffix.lower() == ".npy":
            return _of_array(path, box)
        return _of_image(path, unit)
    except UserError:
        raise
    except Exception as error:  # parsers raise anything
        reason = first_line(error) or type(error).__name__
        raise UserError(
            f"{path}: could not be read as a grid ({reason}); expected .npy with (nx, ny, nz) "
            "numbers, or .vti with cell data"
        ) from None


def _of_array(path: Path, box: Array | None) -> tuple[BoxGrid, dict[str, NDArray[Any]]]:
    # Mapped, so that a header which says more than there is allocates nothing.
    values = np.load(path, mmap_mode="r", allow_pickle=False)
    if values.ndim != 3 or not values.size or values.dtype.kind not in "fiub":
        raise ValueError(f"an array of {values.dtype} and shape {values.shape}")
    if box is None:
        raise UserError(f"{path}: an array has no place; give the box (2, 3) [m] that it fills")
    low, high = np.asarray(box, dtype=float).reshape(2, 3)
    sides = high - low
    if not (np.isfinite(sides).all() and (sides > 0.0).all()):
        raise UserError(f"{path}: found the box {low.tolist()} to {high.tolist()}, expected sides")
    shape = (values.shape[0], values.shape[1], values.shape[2])
    grid = BoxGrid(low, sides / np.array(shape), shape, np.eye(3))
    return grid, {path.stem: np.asarray(values).ravel(order="F")}


def _of_image(path: Path, unit: float) -> tuple[BoxGrid, dict[str, NDArray[Any]]]:
    file = VtkFile.of_content(path.read_bytes(), "ImageData")
    extent = _numbers(file.piece.attrib["Extent"], 6).astype(np.int64)
    low, steps = extent[::2], extent[1::2] - extent[::2]
    if (steps < 0).any():
        raise ValueError(f"its extent is {extent.tolist()}")
    spacing = _numbers(file.grid.get("Spacing", "1 1 1"), 3) * unit
    axes = _numbers(file.grid.get("Direction", "1 0 0 0 1 0 0 0 1"), 9).reshape(3, 3)
    if not (spacing > 0.0).all() or not np.allclose(axes.T @ axes, np.eye(3), atol=1e-6):
        raise ValueError("its spacing is not positive, or its axes are not at right angles")
    origin = _numbers(file.grid.get("Origin", "0 0 0"), 3) * unit + axes @ (spacing * low)
    tags, sizes = file.sections("CellData"), steps
    if not tags:  # boxes around the points
        tags, sizes = file.sections("PointData"), steps + 1
        origin = origin - axes @ (spacing / 2.0)
    count = math.prod(int(size) for size in sizes)
    if not count:
        raise ValueError(f"its extent is {extent.tolist()}, expected boxes along each axis")
    values = {name: file.array(tag, count) for name, tag in tags.items()}
    shape = (int(sizes[0]), int(sizes[1]), int(sizes[2]))
    return BoxGrid(origin, spacing, shape, axes), {
        name: each for name, each in values.items() if each.ndim == 1
    }


def _numbers(text: str, count: int) -> Array:
    values = np.array([float(word) for word in text.split()])
    if len(values) != count or not np.isfinite(values).all():
        raise ValueError(f"found {text!r:.80}, expected {count} numbers")
    return values
