"""Clusters of points by k-means++ (Arthur & Vassilvitskii 2007).

scikit-learn has it too, but to import that takes longer than to solve a small model.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST_ITERATIONS, SETTLED = 100, 1e-3
"""The iteration ends when no more than this fraction of the points changes its cluster."""


def k_means(points: Array, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Cluster (n,) of each point (n, d), 0 to `count` - 1; some clusters may have no points.

    Examples
    --------
    >>> points = np.array([[0.0], [0.1], [5.0], [5.1]])
    >>> near, same, far, alike = k_means(points, 2, np.random.default_rng(0))
    >>> bool(near == same), bool(far == alike), bool(near == far)
    (True, True, False)
    """
    centres = _scattered(points, count, rng)
    cluster = _nearest(points, centres)
    for _ in range(MOST_ITERATIONS):
        size = np.bincount(cluster, minlength=count)
        sums = [np.bincount(cluster, column, minlength=count) for column in points.T]
        filled = size > 0
        centres[filled] = np.stack(sums, axis=1)[filled] / size[filled, None]
        before, cluster = cluster, _nearest(points, centres)
        if np.count_nonzero(cluster != before) <= SETTLED * len(points):
            break
    return cluster


def _scattered(points: Array, count: int, rng: np.random.Generator) -> Array:
    """Points (count, d), each drawn with a chance as its squared distance from those before."""
    chosen = [int(rng.integers(len(points)))]
    distance = np.full(len(points), np.inf)
    while len(chosen) < count:
        distance = np.minimum(distance, ((points - points[chosen[-1]]) ** 2).sum(axis=1))
        total = np.cumsum(distance)
        chosen.append(int(np.searchsorted(total, rng.random() * total[-1], side="right")))
    return points[np.minimum(chosen, len(points) - 1)]


def _nearest(points: Array, centres: Array) -> NDArray[np.int64]:
    """The centre closest to each point."""
    return np.asarray((points @ centres.T - 0.5 * (centres**2).sum(axis=1)).argmax(axis=1))
