"""How little a listener likes a point of a space of heads, from comparisons of pairs.

The cost is a Gaussian process, of which a comparison measures the difference of two values.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import Kernel

from carillon.arrays import Array

OFFSETS = {1: 1.0, 2: 0.5, 3: 0.0, 4: -0.5, 5: -1.0}
"""By how much the first of a pair costs less than the second one, by the score: 1 if the first is
definitely better, 5 if the second is."""
NOISE = 0.5
"""Standard deviation of answers, in differences of costs."""
NEAR = 1.0
"""Radius about which the cone of the cost is round, in standard deviations of the most audible
component."""
BEND, BEND_LENGTH = 0.3, 4.0
"""Variance of what makes the cost no cone, and the distance over which it changes, in standard
deviations."""
REACH = 2.5
"""Greatest coordinate, in standard deviations of the heads, of the point that is liked most."""


@dataclass(frozen=True)
class RatedPair:
    """What a listener said of two points (K,): a score from 1 (first definitely better) to 5."""

    first: Array
    second: Array
    score: int


class DifferenceKernel(Kernel):  # type: ignore[misc]
    """Covariance of differences of costs; a row (2 K,) is the two points of one.

    The cost is about the distance from an unknown point, in the order in which components are
    audible, by their `scales` (K,): a cone r around the mean head, less a slope along z / r, as in
    |z - y| = |z| - y z / |z| + ..., and a smooth rest for what is otherwise.
    """

    def __init__(self, scales: Array) -> None:
        self.scales = scales

    def __call__(self, X: Array, Y: Array | None = None, eval_gradient: bool = False) -> Any:
        """Covariances (a, b) of rows X (a, 2 K) and Y (b, 2 K)."""
        left, right = (
            (each[:, : len(self.scales)], each[:, len(self.scales) :])
            for each in (X, X if Y is None else Y)
        )
        covariances = sum(
            (1.0 if a == b else -1.0) * self._of_costs(left[a], right[b])
            for a in range(2)
            for b in range(2)
        )
        return (
            (covariances, np.empty((*np.shape(covariances), 0))) if eval_gradient else covariances
        )

    def diag(self, X: Array) -> Array:
        """Variances (a,) of rows."""
        return np.array([self(row[None])[0, 0] for row in X])

    def is_stationary(self) -> bool:
        """Whether covariances depend on differences of rows alone: no."""
        return False

    def _of_costs(self, first: Array, second: Array) -> Array:
        audible = self.scales / self.scales.max()
        far, other_far = (np.sqrt(NEAR**2 + _squares(each * audible)) for each in (first, second))
        slope = (first * audible**2) @ second.T / np.outer(far, other_far)
        apart = _squares(first)[:, None] + _squares(second) - 2.0 * first @ second.T
        rest = BEND * np.exp(-0.5 * apart / BEND_LENGTH**2)
        return np.asarray(slope + np.outer(far, other_far) + rest)


def _squares(points: Array) -> Array:
    return np.asarray((points**2).sum(axis=1))


class Preference:
    """Costs of points (K,) after some comparisons, over that of the mean head (0)."""

    def __init__(self, comparisons: Sequence[RatedPair], scales: Array) -> None:
        rows = np.array([np.concatenate([each.first, each.second]) for each in comparisons])
        differences = np.array([-OFFSETS[each.score] for each in comparisons])
        kernel = DifferenceKernel(scales)
        self._regression = GaussianProcessRegressor(kernel, alpha=NOISE**2, optimizer=None)
        self._regression.fit(rows, differences)
        self._dimensions = len(scales)

    def costs(self, points: Array) -> Array:
        """Expected costs (s,) of points (s, K)."""
        rows = np.concatenate([points, np.zeros_like(points)], axis=1)
        return np.asarray(self._regression.predict(rows))

    def least(self, start: Array) -> Array:
        """The point (K,) of least expected cost: the better of two descents (L-BFGS), from a start
        and from the mean head.
        """
        from scipy.optimize import minimize

        bounds = [(-REACH, REACH)] * self._dimensions
        steps = 1e-4 * np.concatenate([np.eye(self._dimensions), -np.eye(self._dimensions)])

        def cost(point: Array) -> tuple[float, Array]:
            around = self.costs(np.concatenate([point[None], point + steps]))
            ahead, behind = np.split(around[1:], 2)
            return around[0], (ahead - behind) / 2e-4

        descents = [
            minimize(cost, each, jac=True, method="L-BFGS-B", bounds=bounds)
            for each in (start, np.zeros(self._dimensions))
        ]
        return np.asarray(min(descents, key=lambda each: each.fun).x)
