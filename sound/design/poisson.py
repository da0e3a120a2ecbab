"""Poisson's ratio of a solid as a coordinate of the search."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carillon.fem.element import elasticity_matrix

FIRST, SECOND = 0.0, 0.4
"""Poisson's ratios of the two elasticity matrices whose combinations are all others."""


@dataclass(frozen=True)
class FreePoisson:
    """Poisson's ratio between bounds, as a function of a coordinate; `start` belongs to 0."""

    low: float
    high: float
    start: float

    def at(self, coordinate: float) -> float:
        """Poisson's ratio: a logistic function, so that it stays within the bounds."""
        share = 1.0 / (1.0 + np.exp(-coordinate) * (self.high - self.start) / self._above)
        return float(self.low + (self.high - self.low) * share)

    def slope(self, poisson: float) -> float:
        """Derivative of Poisson's ratio by the coordinate."""
        return (poisson - self.low) * (self.high - poisson) / (self.high - self.low)

    def coordinate(self, poisson: float) -> float:
        """Inverse of `at`; ratios out of the bounds are moved into them."""
        margin = 1e-3 * (self.high - self.low)
        inside = float(np.clip(poisson, self.low + margin, self.high - margin))
        odds = (inside - self.low) / (self.high - inside)
        return float(np.log(odds * (self.high - self.start) / self._above))

    @property
    def _above(self) -> float:
        return self.start - self.low


def elasticity_slope(poisson: float) -> tuple[float, float]:
    """Weights of the elasticity at `FIRST` and `SECOND` in its derivative by Poisson's ratio.

    Elasticity is linear in the two Lame parameters, so any two span it, exactly.

    Examples
    --------
    >>> step, weights = 1e-6, elasticity_slope(0.3)
    >>> by_weights = sum(w * elasticity_matrix(v) for w, v in zip(weights, (FIRST, SECOND)))
    >>> difference = elasticity_matrix(0.3 + step) - elasticity_matrix(0.3 - step)
    >>> bool(np.allclose(by_weights, difference / (2.0 * step)))
    True
    """
    spread, denominator = 1.0 + poisson, (1.0 + poisson) * (1.0 - 2.0 * poisson)
    slopes = [(1.0 + 2.0 * poisson**2) / denominator**2, -0.5 / spread**2]
    matrices = elasticity_matrix(FIRST), elasticity_matrix(SECOND)
    # The first Lame parameter is off the diagonal, the second one at its end.
    lame = np.array([[matrix[0, 1], matrix[3, 3]] for matrix in matrices]).T
    first, second = np.linalg.solve(lame, slopes)
    return float(first), float(second)
