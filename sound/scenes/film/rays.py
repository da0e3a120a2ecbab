"""Rays through the pixels of a picture, and their intersections with surfaces (Intel's Embree)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from carillon.arrays import Flags
from sound.scenes.packages import scene_package
from sound.scenes.performance import Camera

Floats = NDArray[np.float32]
Window = tuple[slice, slice]
"""Part of a picture: rows and columns."""

CREASE_DEGREES = 40.0
"""Angle between two faces above which their edge is shaded as sharp."""


class View:
    """Pixels of a camera's picture of a width and height [pixels], and rays through them."""

    def __init__(self, camera: Camera, size: tuple[int, int]) -> None:
        self.width, self.height = size
        self.eye = np.array(camera.position, np.float32)
        towards = np.subtract(camera.target, camera.position)
        self.distance = float(np.linalg.norm(towards))
        ahead = towards / self.distance
        across = np.cross(ahead, [0.0, 0.0, 1.0])
        # Looking straight up or down, where no direction is up in the picture.
        long = float(np.linalg.norm(across))
        right = across / long if long > 1e-6 else np.array([1.0, 0.0, 0.0])
        self.axes = np.stack([right, np.cross(ahead, right), ahead]).astype(np.float32)
        self.focus = self.height / float(2.0 * np.tan(np.radians(camera.degrees) / 2.0))
        self.centre = np.array(size, np.float32) / 2.0

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.height, self.width

    def centres(self) -> Floats:
        """Places (H * W, 2) of all pixels, row by row."""
        rows, columns = np.indices(self.shape)
        return np.stack([columns.ravel(), rows.ravel()], axis=1).astype(np.float32) + 0.5

    def directions(self, places: NDArray[np.floating]) -> Floats:
        """Rays (n, 3) from the eye through positions (n, 2) [pixels], 1 m long along the camera's
        axis."""
        aside = (places - self.centre) / self.focus
        return (aside @ self.axes[:2] + self.axes[2]).astype(np.float32)

    def window(self, points: NDArray[np.floating]) -> Window:
        """The window that contains the convex hull of points (n, 3) [m]."""
        seen = (points - self.eye) @ self.axes.T
        if seen[:, 2].min() < 1e-3 * self.distance:  # beside or behind the camera
            return slice(0, self.height), slice(0, self.width)
        places = seen[:, :2] / seen[:, 2:] * self.focus + self.centre
        (left, top), (right, bottom) = places.min(axis=0), places.max(axis=0)
        return _span(top, bottom, self.height), _span(left, right, self.width)


def _span(first: float, last: float, count: int) -> slice:
    """Pixels of a row or column that an interval touches."""
    begin, end = np.clip([np.floor(first), np.floor(last) + 1.0], 0, count)
    return slice(int(begin), int(end))


class Meetings(NamedTuple):
    """First intersections with a surface of those rays that meet it, by their numbers (m,).

    `ways` (m,) are distances, in lengths of the rays' directions; `normals` (m, 3) are unit vectors
    on the rays' side, smooth but for creases, and `faces` (m,) the triangles.
    """

    rays: NDArray[np.intp]
    ways: Floats
    normals: Floats
    faces: NDArray[np.integer]


class RayedSurface:
    """A surface of vertices (V, 3) [m] and triangles (F, 3) in its own axes, intersected by rays.

    `radius` [m] is that of the sphere around it, about the origin of its axes, and `corners` (8, 3)
    [m] are those of the box around it.
    """

    def __init__(self, vertices: NDArray[np.float64], faces: NDArray[np.integer]) -> None:
        self.vertices = vertices.astype(np.float32)
        self.radius = float(np.linalg.norm(vertices, axis=1).max())
        ends = np.sort(self.vertices, axis=0)[[0, -1]]
        self.corners = ends[np.indices((2, 2, 2)).reshape(3, -1).T, np.arange(3)]
        self.normals = corner_normals(vertices, faces).astype(np.float32)
        self._scene = scene_package("embreex.rtcore_scene").EmbreeScene()
        scene_package("embreex.mesh_construction").TriangleMesh(
            self._scene, self.vertices, faces.astype(np.int32)
        )

    def meet(self, origins: Floats, directions: Floats) -> Meetings:
        """First intersections with rays (n, 3)."""
        hits = self._scene.run(origins, directions, output=1)
        rays = np.flatnonzero(hits["primID"] >= 0)
        u, v, faces, outwards = (hits[key][rays] for key in ("u", "v", "primID", "Ng"))
        shares = np.stack([1.0 - u - v, u, v], axis=1)
        normals = np.einsum("ij,ijk->ik", shares, self.normals[faces])
        inside = np.einsum("ij,ij->i", outwards, directions[rays]) > 0.0
        normals[inside] *= -1.0
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        return Meetings(rays, hits["tfar"][rays], normals, faces)

    def hides(self, origins: Floats, directions: Floats) -> Flags:
        """Which rays (n,) hit the surface."""
        return np.asarray(self._scene.run(origins, directions, query="OCCLUDED") >= 0)


@dataclass(frozen=True)
class PlacedSurface:
    """A surface in a scene: `position` (3,) [m] of the origin of its axes, and `rotation` (3, 3)
    from these to the scene's.
    """

    surface: RayedSurface
    position: Floats
    rotation: Floats

    def points(self, own: Floats) -> Floats:
        """Points (n, 3) [m] in the scene of points in the surface's axes."""
        return own @ self.rotation.T + self.position

    def meet(self, eye: Floats, directions: Floats) -> Meetings:
        """First intersections with rays (n, 3) from one point."""
        origins = np.broadcast_to((eye - self.position) @ self.rotation, directions.shape)
        met = self.surface.meet(origins, directions @ self.rotation)
        return met._replace(normals=met.normals @ self.rotation.T)

    def hides(self, origins: Floats, directions: Floats) -> Flags:
        """Which rays (n,) hit the surface."""
        origins = (origins - self.position) @ self.rotation
        return self.surface.hides(origins, directions @ self.rotation)

    def may_shade(self, other: PlacedSurface, sun: Floats) -> bool:
        """Whether it may shade another surface from the sun, by the spheres around both."""
        between = self.position - other.position
        along, reach = float(between @ sun), self.surface.radius + other.surface.radius
        return along > -reach and float(np.linalg.norm(between - along * sun)) < reach


def corner_normals(
    vertices: NDArray[np.float64],
    faces: NDArray[np.integer],
    crease_degrees: float = CREASE_DEGREES,
) -> NDArray[np.float64]:
    """Unit normals (F, 3, 3) at the corners of triangles.

    Each is the mean, weighted by areas, of the normals of the faces around the vertex that differ
    from the corner's own face by less than the crease's angle.

    Examples
    --------
    Two triangles that fold by 90 degrees keep their own normals.

    >>> points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> folded = np.array([[0, 1, 2], [0, 3, 1]])
    >>> corner_normals(points, folded)[:, 0]
    array([[0., 0., 1.],
           [0., 1., 0.]])
    >>> corner_normals(points, folded, crease_degrees=100.0)[:, 0].round(3)
    array([[0.   , 0.707, 0.707],
           [0.   , 0.707, 0.707]])
    """
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    across = np.cross(b - a, c - a)
    flat = _unit(across)
    corner, other = _sharing(faces, len(vertices))
    level = np.einsum("ij,ij->i", flat[corner // 3], flat[other // 3])
    near = (level >= np.cos(np.radians(crease_degrees))) | (corner == other)
    where = corner[near], other[near] // 3
    sums = csr_matrix((np.ones(len(where[0])), where), (faces.size, len(faces))) @ across
    return _unit(sums).reshape(-1, 3, 3)


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors (n, 3) normalised; zero vectors stay zero."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(lengths > 0.0, lengths, 1.0)


def _sharing(
    faces: NDArray[np.integer], count: int
) -> tuple[NDArray[np.integer], NDArray[np.integer]]:
    """All pairs of corners at the same vertex, numbered as in `faces.ravel()`."""
    corners = np.arange(faces.size)
    at = csr_matrix((np.ones(faces.size), (corners, faces.ravel())), (faces.size, count))
    pairs = (at @ at.T).tocoo()
    return pairs.row, pairs.col
