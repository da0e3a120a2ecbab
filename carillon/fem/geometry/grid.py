"""Cubes that a solid is put on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:  # Its import takes long, and many commands need no surface.
    import trimesh


@dataclass(frozen=True, eq=False)
class Grid:
    """Cubes of edge `edge` [m], `shape` of them along the axes, from the corner `origin` [m]."""

    origin: np.ndarray
    edge: float
    shape: tuple[int, int, int]


def bounding_grid(surface: trimesh.Trimesh, resolution: int) -> Grid:
    """Grid with `resolution` voxels along the longest side of the bounding box, centred on it."""
    low, high = np.asarray(surface.bounds)
    edge = float((high - low).max() / resolution)
    # The tolerance keeps a side of exactly n voxels from rounding up to n + 1.
    shape = np.maximum(np.ceil((high - low) / edge - 1e-6), 1).astype(int)
    return Grid(
        (low + high - edge * shape) / 2, edge, (int(shape[0]), int(shape[1]), int(shape[2]))
    )
