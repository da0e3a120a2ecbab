"""Directions around a head that were measured, and those between them."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from carillon.errors import UserError

WIDEST = np.radians(25.0)
"""Angle [rad] from the middle of a triangle to its corners above which what it spans counts as not
measured."""
LEAST = 12
"""Least number of distinct directions."""
SAME = 1e-9
"""Greatest distance of unit vectors that are one direction."""
IN_PLANE = 1e-6
"""Relative difference of distances below which triangles are in one plane."""
AT_ONCE = 1 << 22
"""Pairs of a direction and a triangle that are held in memory together."""


class DirectionMesh:
    """Triangles between measured directions (M, 3), in which all others are interpolated.

    A direction u in the triangle of a, b, c has the barycentric coordinates of the point at which
    the ray along u meets it.  Large triangles are gaps of the measurement: directions in there are
    taken from the nearest point of its edge.  Raises UserError if the directions span no space.
    """

    def __init__(self, directions: Array) -> None:
        from scipy.spatial import ConvexHull, QhullError

        self.directions = directions
        _, first = np.unique(
            np.round(directions / SAME).astype(np.int64), axis=0, return_index=True
        )
        first = np.sort(first)
        if len(first) < LEAST:
            raise UserError(
                f"has {len(first)} directions, expected at least {LEAST} all around the head"
            )
        try:
            hull = ConvexHull(directions[first])
        except QhullError:
            raise UserError(
                "has directions in one plane alone, expected directions all around the head"
            ) from None
        corners = first[hull.simplices]
        normals, heights = hull.equations[:, :3], -hull.equations[:, 3]
        measured = heights > np.cos(WIDEST)
        if not measured.any():
            raise UserError(
                f"has no directions within {np.degrees(WIDEST):.0f} degrees of each other, "
                "expected directions all around the head"
            )
        self.triangles: NDArray[np.intp] = corners[measured]
        self._planes = normals[measured] / heights[measured, None]
        self._inverses = np.linalg.inv(directions[self.triangles])
        self.is_closed = bool(measured.all())

    @cached_property
    def edges(self) -> NDArray[np.intp]:
        """Pairs (E, 2) of directions along the edge of what was measured."""
        pairs = np.sort(self.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        unique, counts = np.unique(pairs, axis=0, return_counts=True)
        return unique[counts == 1]

    @cached_property
    def shares(self) -> Array:
        """Shares (M,) of the measured directions in the area of all triangles; their sum is 1."""
        corners = self.directions[self.triangles]
        doubled = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        areas = np.repeat(np.linalg.norm(doubled, axis=1), 3)
        total = np.bincount(self.triangles.ravel(), areas, len(self.directions))
        return np.asarray(total / total.sum())

    def weights(self, directions: Array) -> tuple[NDArray[np.intp], Array, NDArray[np.bool_]]:
        """Corners (s, 3) and their weights (s, 3), which sum to 1, of unit vectors (s, 3).

        The third part (s,) tells which directions were not measured.
        """
        count = max(1, AT_ONCE // max(len(self.triangles), len(self.edges)))
        parts = [
            self._weights(directions[first : first + count])
            for first in range(0, len(directions), count)
        ]
        corners, weights, unmeasured = (np.concatenate(each) for each in zip(*parts))
        return corners, weights, unmeasured

    def _weights(self, directions: Array) -> Sequence[NDArray[np.generic]]:
        # A ray leaves a convex solid through the plane that it meets first, which several
        # triangles may have in common.
        met = directions @ self._planes.T
        row, triangle = np.nonzero(met >= met.max(axis=1, keepdims=True) * (1.0 - IN_PLANE))
        weights = np.einsum("si,sij->sj", directions[row], self._inverses[triangle])
        order = np.lexsort((weights.min(axis=1), row))
        last = order[np.append(np.diff(row[order]) > 0, True)]
        corners, weights = self.triangles[triangle[last]], weights[last]
        unmeasured = weights.min(axis=1) < -1e-6 * np.abs(weights).max(axis=1)
        weights = np.maximum(weights, 0.0)
        if not self.is_closed and unmeasured.any():
            away = np.flatnonzero(unmeasured)
            ends, shares = self._nearest_edge(directions[away])
            corners[away, :2], corners[away, 2] = ends, ends[:, 0]
            weights[away, :2], weights[away, 2] = shares, 0.0
        return corners, weights / weights.sum(axis=1, keepdims=True), unmeasured

    def _nearest_edge(self, directions: Array) -> tuple[NDArray[np.intp], Array]:
        """Ends (s, 2) of the nearest edges and the weights (s, 2) of the nearest points on them."""
        first, second = self.directions[self.edges].transpose(1, 0, 2)
        cosine = np.einsum("ei,ei->e", first, second)
        along = np.stack([directions @ first.T, directions @ second.T], axis=2)
        # In the plane of both ends, the part of a direction is their sum with these factors.
        factors = (along - cosine[:, None] * along[:, :, ::-1]) / (1.0 - cosine**2)[:, None]
        low, high = factors.min(axis=2), factors.max(axis=2)
        beyond = (low < 0.0) | (high <= 0.0)
        ends = np.eye(2)[np.argmax(along, axis=2)]
        factors = np.where(beyond[:, :, None], ends, factors)
        points = factors[:, :, :1] * first + factors[:, :, 1:] * second
        near = np.einsum("sei,si->se", points, directions) / np.linalg.norm(points, axis=2)
        nearest = np.argmax(near, axis=1)
        shares = factors[np.arange(len(directions)), nearest]
        return self.edges[nearest], shares / shares.sum(axis=1, keepdims=True)
