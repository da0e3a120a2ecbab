"""Points of a solid as weights of the unknowns of its model, and the motion of modes there."""

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from carillon.arrays import Array, Index
from carillon.fem.geometry import CORNER_OFFSETS, HexMesh
from carillon.fem.model import Solid


def motion_at(model: Solid, modes: Array, points: Array) -> Array:
    """Displacement (p, 3, k) of `points` (p, 3) [m] in modes (n_dofs, k)."""
    values = interpolation(model, points)
    motion = values @ modes.reshape(model.mesh.n_nodes, -1)
    return np.asarray(motion).reshape(values.shape[0], 3, -1)


def forces_at(model: Solid, points: Array, directions: Array) -> Array:
    """Forces (n_dofs, p) on the unknowns by forces `directions` (p, 3) at `points` (p, 3) [m]."""
    weights = interpolation(model, points).toarray()
    return np.asarray((weights[:, :, None] * directions[:, None, :]).reshape(len(points), -1).T)


def interpolation(model: Solid, points: Array) -> sp.csr_matrix:
    """Interpolation from the nodes to `points` (p, 3) [m], as a matrix (p, n).

    A point outside all elements takes the value of the nearest point of a nearest one.

    Examples
    --------
    >>> from carillon.fem.geometry import hexmesh_from_grid
    >>> from carillon.fem.model import fine_model
    >>> mesh = hexmesh_from_grid(np.array([[0, 0, 0], [1, 0, 0]]), np.zeros(3), 0.5)
    >>> model = fine_model(mesh, np.ones(2))
    >>> interpolation(model, np.array([[0.25, 0.0, 0.0], [1.0, 0.5, 0.0]])).toarray()[:, :6]
    array([[0.5, 0.5, 0. , 0. , 0. , 0. ],
           [0. , 0. , 0. , 0. , 0. , 1. ]])
    """
    elements, weights = embedding(model, points)
    rows = np.repeat(np.arange(len(elements)), weights.shape[1])
    shape = (len(elements), model.mesh.n_nodes)
    nodes = model.connectivity[elements]
    matrix = sp.csr_matrix((weights.ravel(), (rows, nodes.ravel())), shape=shape)
    matrix.eliminate_zeros()
    return matrix


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
    return cells, model.shape_values(cells, np.clip(local, 0.0, 1.0))


def _nearest_place(places: NDArray[np.int32], spans: Array, position: Array) -> Index:
    """Number (p,) of the place whose cube, of edge `spans`, positions (p, 3) lie in or nearest."""
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
