"""The surface of a solid in any discretisation, with its normals."""

import logging
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from carillon.arrays import Array, Index
from carillon.errors import UserError
from carillon.fem.finite_cells.cells import surface_points
from carillon.fem.finite_cells.model import FiniteCellModel
from carillon.fem.geometry import HexMesh
from carillon.fem.geometry.faces import boundary_faces, surface_quads
from carillon.fem.geometry.size import length_in_words
from carillon.fem.model import Solid

logger = logging.getLogger(__name__)

SMOOTHING = 2
"""Number of rings of faces that a normal is averaged over. Faces of voxels look along the axes
only."""
REACH = 3.0
"""Largest distance of a named point from the surface, in cell edges."""
FITTED = 12
"""Number of points on the surface of finite cells that a tangent plane is fitted to."""
OUTSIDE = 0.1
"""Largest distance outside the surface of finite cells at which a point counts as on it, in cell
edges."""
VANISHING = 1e-6
"""Length of a sum of unit normals below which it has no direction."""


@dataclass(frozen=True)
class Surface:
    """Points all over a surface."""

    points: Array
    """(s, 3) where they are [m]."""
    outward: Array
    """(s, 3) unit normals."""
    edge: float
    """Cell edge, or spacing [m]."""
    nodes: Index | None
    """(s,) nodes that the points are; None if they lie between nodes."""

    def nearest(self, point: Array, what: str, reach: float | None = None) -> int:
        """Number of the point nearest to `point` (3,) [m].

        Raises UserError if the point, which the message calls `what`, is further than `reach` [m]
        from the surface, `REACH` unless told.
        """
        reach = REACH * self.edge if reach is None else reach
        distance, index = cKDTree(self.points).query(point)
        if distance > reach:
            kind = "solid" if self.nodes is None else "voxels"
            raise UserError(
                f"{what}: the point ({_shown(point)}) m is {length_in_words(distance)} from the "
                f"surface of the {kind}, expected at most {length_in_words(reach)}; the nearest "
                f"one is ({_shown(self.points[index])}) m"
            )
        return int(index)

    def place(self, point: Array, what: str, reach: float | None = None) -> tuple[Array, Array]:
        """The place (3,) [m] that is meant by `point` (3,) [m], and the inward normal (3,) there.

        That is the nearest node of voxels. Of finite cells it is the point itself, unless it lies
        outside, or deep inside: then the nearest place of the surface. A warning says how far that
        is from a point that is not on the surface. Raises UserError, see `nearest`.
        """
        index = self.nearest(point, what, reach)
        place, outward = self.points[index], self.outward[index]
        if self.nodes is None:
            place, outward = self._tangent_plane(index)
        beyond = float((point - place) @ outward)
        along = point - place - beyond * outward
        is_near = np.linalg.norm(along) <= self.edge and beyond >= -REACH * self.edge
        if self.nodes is None and is_near:
            place = point if beyond <= OUTSIDE * self.edge else place + along
        distance = float(np.linalg.norm(point - place))
        if distance > self.edge * (OUTSIDE if self.nodes is None else 1.0):
            logger.warning(
                f"{what}: the point ({_shown(point)}) m is {length_in_words(distance)} off the "
                f"surface; ({_shown(place)}) m is taken instead"
            )
        return place, -outward

    def _tangent_plane(self, index: int) -> tuple[Array, Array]:
        """Foot (3,) [m] of a point on the plane of its neighbours, and the outward normal (3,).

        Normals of the points themselves are averaged over faces of voxels, and look away from the
        surface's own where a wall is as thin as a voxel.
        """
        point = self.points[index]
        _, near = cKDTree(self.points).query(point, min(FITTED, len(self.points)))
        alike = near[self.outward[near] @ self.outward[index] > 0.5]
        middle = self.points[alike].mean(axis=0)
        normal = np.linalg.svd(self.points[alike] - middle)[2][2]
        if normal @ self.outward[index] < 0.0:
            normal = -normal
        return point - ((point - middle) @ normal) * normal, normal


def surface_of(model: Solid) -> Surface:
    """Nodes on the surface of hexahedra, or a point of it for each outer face of cells' voxels."""
    mesh = model.mesh
    if not isinstance(model, FiniteCellModel):
        nodes, outward = surface_normals(mesh)
        return Surface(mesh.nodes[nodes], outward, mesh.edge, nodes)
    quads, voxels = boundary_faces(mesh)
    _, outward = _face_normals(mesh, quads)
    return Surface(surface_points(model.cells, voxels, outward), outward, mesh.edge, None)


def surface_normals(mesh: HexMesh) -> tuple[Index, Array]:
    """Nodes on the surface (s,) and their outward unit normals (s, 3).

    The normals of the faces are averaged over `SMOOTHING` rings of neighbours.
    """
    quads = surface_quads(mesh)
    own, faces = _face_normals(mesh, quads)
    nodes = np.unique(quads)
    # Where a sheet of one cell's thickness ends, neighbours may cancel.
    plain = _unit(_at_nodes(mesh, quads, own), np.array([0.0, 0.0, 1.0]))
    return nodes, _unit(_at_nodes(mesh, quads, faces), plain)[nodes]


def _face_normals(mesh: HexMesh, quads: NDArray[np.int32]) -> tuple[Array, Array]:
    """Unit normals (q, 3) of faces, their own and smoothed."""
    corners = mesh.nodes[quads]
    own = _unit(np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]))
    faces = own
    for _ in range(SMOOTHING):
        faces = _unit(_at_nodes(mesh, quads, faces)[quads].mean(axis=1), own)
    return own, faces


def _at_nodes(mesh: HexMesh, quads: NDArray[np.int32], faces: Array) -> Array:
    """Sum (n, 3) of the faces' vectors (q, 3) at their corners."""
    sums = np.zeros((mesh.n_nodes, 3))
    np.add.at(sums, quads, faces[:, None, :])
    return sums


def _unit(vectors: Array, otherwise: Array | None = None) -> Array:
    """The vectors (.., 3) at length one; those that vanish are replaced."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    if otherwise is not None:
        vectors = np.where(length > VANISHING, vectors, otherwise)
        length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.maximum(length, np.finfo(float).tiny))


def _shown(point: Array) -> str:
    return ", ".join(f"{value:.4g}" for value in point)
