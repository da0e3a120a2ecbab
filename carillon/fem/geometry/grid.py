"""Cubes that a solid is put on."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

ROUNDED = 1e-3
"""Part of a voxel by which sides may exceed whole voxels: files round coordinates."""


@dataclass(frozen=True, eq=False)
class Grid:
    """Cubes of edge `edge` [m], `shape` of them along the axes, from the corner `origin` [m]."""

    origin: np.ndarray
    edge: float
    shape: tuple[int, int, int]


class HasBounds(Protocol):
    """A surface, or what else has a box around it."""

    @property
    def bounds(self) -> np.ndarray | None:
        """Lowest and highest corner (2, 3) [m]."""


def bounding_grid(surface: HasBounds, resolution: int) -> Grid:
    """Grid with `resolution` voxels along the longest side of the bounding box, centred on it.

    Voxels are larger by as much as spares a layer of them for sides that exceed it by `ROUNDED`.
    """
    low, high = np.asarray(surface.bounds)
    extents = high - low
    edge = float(extents.max() / resolution)
    fewer = np.maximum(np.ceil(extents / edge - ROUNDED), 1)
    if (fewer < _whole(extents / edge)).any():
        edge = float((extents / fewer).max())
    shape = _whole(extents / edge).astype(int)
    return Grid(
        (low + high - edge * shape) / 2, edge, (int(shape[0]), int(shape[1]), int(shape[2]))
    )


def _whole(sizes: np.ndarray) -> np.ndarray:
    """Whole voxels; the tolerance keeps a side of exactly n of them from rounding up to n + 1."""
    return np.asarray(np.maximum(np.ceil(sizes - 1e-6), 1))
