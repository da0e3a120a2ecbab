"""Places that were painted: what lies below some parts of a surface."""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np

from carillon.arrays import Array, Flags, Index, Surface
from carillon.composition.places import Where

ON_SURFACE = 1e-6
"""Distance from the surface, in its longest sides, within which a point is on it."""
ANOTHER_SIDE = -0.3
"""Product of the unit normals of a dab and a place from which that is on the other side."""


class Painted(Where):
    """The part of a solid below painted parts of its surface, as deep as the paint goes.

    A point is of it if the point of the surface that is nearest to it is painted: within the
    radius of one of the dabs, and, if the paint has a depth, on the side of the wall that this is
    on.

    Parameters
    ----------
    surface
        [m]
    dabs
        Places and radii (d, 4) [m]; a negative radius takes paint away, and of several in one place
        the last one counts.
    depth
        Greatest distance [m] from the surface; if None, the paint goes through walls that are
        thinner than its radius, and else to where another part of the surface is nearer.

    Examples
    --------
    >>> import trimesh
    >>> plate = trimesh.creation.box(extents=[1.0, 1.0, 0.1])
    >>> place = Painted(plate, [(0.0, 0.0, 0.05, 0.2), (0.1, 0.0, 0.05, -0.05)])
    >>> place.contains(np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.04], [0.3, 0.0, 0.0]])).tolist()
    [True, False, False]
    """

    def __init__(
        self, surface: Surface, dabs: Sequence[Sequence[float]], depth: float | None = None
    ) -> None:
        self._vertices = np.ascontiguousarray(surface.vertices, dtype=float)
        self._faces = np.ascontiguousarray(surface.faces, dtype=np.int64)
        self._dabs = np.array(dabs, dtype=float).reshape(-1, 4)
        self._depth = np.inf if depth is None else depth
        self._slight = ON_SURFACE * float(np.ptp(self._vertices, axis=0).max())
        self._normals = self._nearest(np.ascontiguousarray(self._dabs[:, :3]))[2]

    def contains(self, points: Array) -> Flags:
        found = np.zeros(len(points), dtype=bool)
        given = np.ascontiguousarray(points, dtype=float)
        near = self._within_reach(given)
        if not len(near):
            return found
        squares, places, normals = self._nearest(given[near])
        shallow = squares <= (self._depth + self._slight) ** 2
        least = -np.inf if np.isinf(self._depth) else ANOTHER_SIDE
        found[near[shallow]] = _painted(
            places[shallow], normals[shallow], self._dabs, self._normals, least, self._slight
        )
        return found

    def _nearest(self, points: Array) -> tuple[Array, Array, Array]:
        """Squared distances (p,) of the surface, its nearest points (p, 3) and their normals."""
        import igl  # Its import takes long.

        squares, faces, places = igl.point_mesh_squared_distance(
            points, self._vertices, self._faces
        )[:3]
        corners = self._vertices[self._faces[np.ravel(faces)]]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(across, axis=1, keepdims=True)
        normals = across / np.where(length > 0.0, length, 1.0)
        return np.ravel(squares), np.ascontiguousarray(np.reshape(places, (-1, 3))), normals

    def _within_reach(self, points: Array) -> Index:
        """Numbers of the points that a depth may let be in it."""
        added = self._dabs[self._dabs[:, 3] > 0.0]
        if not len(added):
            return np.empty(0, dtype=np.int64)
        if np.isinf(self._depth):
            return np.arange(len(points))
        reach = added[:, 3, None] + self._depth + 2.0 * self._slight
        low, high = (added[:, :3] - reach).min(axis=0), (added[:, :3] + reach).max(axis=0)
        return np.flatnonzero(((points >= low) & (points <= high)).all(axis=1))


@numba.njit(cache=True, nogil=True)
def _painted(points, normals, dabs, facing, least, slight):  # type: ignore[no-untyped-def]
    """Whether the last dab over each of the points (p, 3) adds paint.

    Dabs count where their normals (d, 3) and those of points (p, 3) have a product above `least`.
    """
    flags = np.zeros(len(points), dtype=np.bool_)
    for point in range(len(points)):
        for dab in range(len(dabs) - 1, -1, -1):
            square, product = 0.0, 0.0
            for axis in range(3):
                square += (points[point, axis] - dabs[dab, axis]) ** 2
                product += normals[point, axis] * facing[dab, axis]
            radius = abs(dabs[dab, 3]) + slight
            if square <= radius * radius and product > least:
                flags[point] = dabs[dab, 3] > 0.0
                break
    return flags
