"""Elements that points of a solid lie in."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from carillon.arrays import Array, Index

if TYPE_CHECKING:  # A solid uses it.
    from carillon.fem.model import Solid


def embedding(model: Solid, points: Array) -> tuple[Index, Array]:
    """Elements (p,) that `points` (p, 3) [m] lie in, and weights (p, k) of their nodes.

    A point outside all elements belongs to a nearest one, see `Elements.shape_values`. Of
    several elements in one place, parts of a block, it belongs to that with the nearest material.
    """
    points = np.atleast_2d(points)
    low, edges = model.boxes
    # Places in quarters of the smallest elements: their corners are integers.
    keys = np.rint(4.0 * np.column_stack([low - low.min(axis=0), edges]) / edges.min())
    _, first, number, count = np.unique(
        keys.astype(np.int64), axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    place = _nearest_place(low[first], edges[first], points)
    order = np.argsort(number.ravel(), kind="stable")
    start = np.cumsum(count) - count
    cells = order[start[place]]
    shared = np.flatnonzero(count[place] > 1)
    if len(shared):
        most = np.arange(count.max())
        there = most < count[place[shared], None]
        at = start[place[shared], None] + np.where(there, most, 0)
        candidates = order[at]
        distance = model.far_from_material(candidates, points[shared])
        cells[shared] = candidates[np.arange(len(shared)), distance.argmin(axis=1)]
    local = (points - low[cells]) / edges[cells, None]
    return cells, model.elements.shape_values(cells, local)


def _nearest_place(low: Array, edges: Array, points: Array) -> Index:
    """Number (p,) of the cube, of lowest corner and edge, that points (p, 3) lie in or nearest."""
    from scipy.spatial import cKDTree  # Its import takes long.

    nearest = np.zeros(len(points), dtype=np.int64)
    least = np.full(len(points), np.inf)
    sizes = np.rint(edges / edges.min())
    for size in np.unique(sizes):
        there = np.flatnonzero(sizes == size)
        half = edges[there[0]] / 2.0
        # In the largest norm a cube is the ball around its centre.
        distance, number = cKDTree(low[there] + half).query(points, p=np.inf)
        closer = distance - half < least
        least[closer] = (distance - half)[closer]
        nearest[closer] = there[number[closer]]
    return nearest
