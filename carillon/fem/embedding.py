"""Elements that points of a solid lie in."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Index
from carillon.fem.geometry import CORNER_OFFSETS, HexMesh

if TYPE_CHECKING:  # A solid uses it.
    from carillon.fem.model import Solid


def embedding(model: Solid, points: Array) -> tuple[Index, Array]:
    """Elements (p,) that `points` (p, 3) [m] lie in, and weights (p, k) of their nodes.

    A point outside all elements belongs to a nearest one, with the weights of its nearest point. Of
    several elements in one place, parts of a block, it belongs to that with the nearest material.
    """
    mesh = model.hexmesh
    position = (np.atleast_2d(points) - mesh.origin) / mesh.edge
    places, first, count = np.unique(mesh.grid, axis=0, return_index=True, return_counts=True)
    spans = np.ones(mesh.n_cells) if mesh.span is None else mesh.span.astype(float)
    place = _nearest_place(places, spans[first], position)
    cells = first[place]
    shared = np.flatnonzero(count[place] > 1)
    if len(shared):
        candidates = cells[shared, None] + np.arange(count.max())
        there = np.arange(count.max()) < count[place[shared], None]
        candidates = np.where(there, candidates, cells[shared, None])
        distance = _from_material(model, mesh, candidates, spans, position[shared])
        cells[shared] = candidates[np.arange(len(shared)), distance.argmin(axis=1)]
    local = (position - mesh.grid[cells]) / spans[cells, None]
    return cells, model.elements.shape_values(cells, np.clip(local, 0.0, 1.0))


def _nearest_place(places: NDArray[np.int32], spans: Array, position: Array) -> Index:
    """Number (p,) of the place whose cube, of edge `spans`, positions (p, 3) lie in or nearest."""
    from scipy.spatial import cKDTree  # Its import takes long.

    nearest = np.zeros(len(position), dtype=np.int64)
    least = np.full(len(position), np.inf)
    for span in np.unique(spans):
        there = np.flatnonzero(spans == span)
        # In the largest norm a cube is the ball around its centre.
        distance, number = cKDTree(places[there] + span / 2.0).query(position, p=np.inf)
        closer = distance - span / 2.0 < least
        least[closer] = (distance - span / 2.0)[closer]
        nearest[closer] = there[number[closer]]
    return nearest


def _from_material(
    model: Solid, mesh: HexMesh, cells: Index, spans: Array, position: Array
) -> Array:
    """Distance (p, c) of positions (p, 3) from the nearest filled octant of cells (p, c)."""
    octants = model.filled[cells]
    middles = spans[cells][:, :, None, None] * (CORNER_OFFSETS + 0.5) / 2.0
    centres = mesh.grid[cells][:, :, None] + middles
    distance = np.linalg.norm(centres - position[:, None, None], axis=3)
    return np.asarray(np.where(octants, distance, np.inf).min(axis=2))
