"""Points of a surface where a solid is struck or watched, and any of its meshes seen there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from carillon.fem.geometry import CORNER_OFFSETS, HexMesh
from carillon.fem.model import RIGID_MODES, Solid
from solver.files.modes_file import ModesFile
from solver.response.surface import Surface, surface_of

Array = NDArray[np.float64]

RULING_MODES = 6
"""Elastic modes, from the first on, that decide where a solid is struck."""
FAR = 0.5
"""Share of the largest distance on the surface from the strike that counts as far from it."""


@dataclass(frozen=True)
class Contact:
    """A point of the surface.

    Attributes
    ----------
    position : (3,) [m]
        Where it is.
    inward : (3,)
        Unit vector into the solid.
    """

    position: Array
    inward: Array


def choose_contacts(
    truth: ModesFile, strike: Sequence[float] | None = None, observed: Sequence[float] | None = None
) -> list[Contact]:
    """Three points on the surface: where it is struck, where it is watched, and one far from both.

    Parameters
    ----------
    truth
        The modes that choose: it is struck where the lowest ones give way most to a push along the
        normal, and watched where, far from there, it then moves most.
    strike, observed
        Positions (3,) [m] that a person wants instead, see `solver.response.surface.Surface.place`.

    Raises
    ------
    UserError
        If a position is away from the surface.
    """
    surface = surface_of(truth.model)
    motion, eigenvalues = _ruling_modes(truth, surface)
    along = np.einsum("sik,si->sk", motion, surface.outward)
    first = int(np.argmax((along**2 / eigenvalues).sum(axis=1)))
    struck = _contact(surface, first, strike, "strike")
    if strike is not None:
        first = surface.nearest(struck.position, "strike")
    away = np.linalg.norm(surface.points - struck.position, axis=1)
    swing = ((motion**2).sum(axis=1) * (along[first] ** 2 / eigenvalues)).sum(axis=1)
    second = int(np.argmax(np.where(away >= FAR * away.max(), swing, -1.0)))
    watched = _contact(surface, second, observed, "observed")
    from_watched = np.linalg.norm(surface.points - watched.position, axis=1)
    third = int(np.argmax(np.minimum(away, from_watched)))
    return [struck, watched, _contact(surface, third)]


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


def embedding(model: Solid, points: Array) -> tuple[NDArray[np.int64], Array]:
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


def _nearest_place(places: NDArray[np.int32], spans: Array, position: Array) -> NDArray[np.int64]:
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
    model: Solid, mesh: HexMesh, cells: NDArray[np.int64], spans: Array, position: Array
) -> Array:
    """Distance (p, c) of positions (p, 3) from the nearest filled octant of cells (p, c)."""
    octants = model.filled[cells]
    middles = spans[cells][:, :, None, None] * (CORNER_OFFSETS + 0.5) / 2.0
    centres = mesh.grid[cells][:, :, None] + middles
    distance = np.linalg.norm(centres - position[:, None, None], axis=3)
    return np.asarray(np.where(octants, distance, np.inf).min(axis=2))


def _contact(
    surface: Surface, index: int, wanted: Sequence[float] | None = None, what: str = ""
) -> Contact:
    """The point of the surface with this number, or the one that a person wants."""
    if wanted is not None:
        return Contact(*surface.place(np.asarray(wanted, dtype=float), what))
    return Contact(surface.points[index], -surface.outward[index])


def _ruling_modes(truth: ModesFile, surface: Surface) -> tuple[Array, Array]:
    """Their motion (s, 3, k) at the points of the surface, and eigenvalues (k,)."""
    assert truth.modes is not None
    chosen = slice(RIGID_MODES, RIGID_MODES + RULING_MODES)
    nodal = truth.modes[:, chosen].reshape(truth.mesh.n_nodes, -1)
    if surface.nodes is None:
        seen = interpolation(truth.model, surface.points) @ nodal
    else:
        seen = nodal[surface.nodes]
    return seen.reshape(len(surface.points), 3, -1), truth.eigenvalues[chosen]
