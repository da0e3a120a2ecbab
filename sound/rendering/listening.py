"""How loud a strike is heard, and what a clip holds besides its modes, anywhere on the surface."""

from __future__ import annotations

from dataclasses import dataclass
from math import gcd

import numpy as np
from numpy.typing import NDArray

from sound.project.design_file import Design
from sound.rendering.solid import SoundingSolid

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Listening:
    """What the clips tell about loudness and noise at the points where they were assigned.

    A clip does not tell how hard its object was struck: it is taken for the sound of 1 N s along
    the inward normal, and the gain of its point lets the loudest mode there be as loud as the
    clip's, which is how Eq. 2 compares them.  Elsewhere gains and residuals are averages weighted
    by the inverse square of the distance.

    Attributes
    ----------
    positions : (T, 3) [m]
        Of the struck points.
    gains : (T,) [kg^1/2 N^-1 s^-1]
        Samples of full scale per amplitude.
    residuals : T arrays (s,)
        The clips less their modes, after 1 N s.
    rates : T integers [Hz]
        Sampling rates of the residuals.
    """

    positions: Array
    gains: Array
    residuals: tuple[Array, ...]
    rates: tuple[int, ...]

    @classmethod
    def of_design(cls, design: Design, solid: SoundingSolid) -> Listening:
        """Gains of a solid's modes at the struck points of a design, and the clips' residuals."""
        targets = design.targets
        positions = np.array([strike.position for strike in design.strikes])
        inward = np.array([strike.inward for strike in design.strikes])
        loudest = solid.amplitudes(positions, inward).max(axis=1)
        gains = targets.amplitudes.max(axis=1) / loudest
        return cls(positions, gains, targets.residuals, targets.rates)

    def weights(self, position: Array) -> Array:
        """Weights (T,) of the struck points at a point (3,) [m]; 1 for the point itself."""
        square = ((self.positions - position) ** 2).sum(axis=1)
        nearest = square.min()
        if nearest == 0.0:
            return np.asarray((square == 0.0).astype(float))
        inverse = nearest / square
        return np.asarray(inverse / inverse.sum())

    def gain(self, position: Array) -> float:
        """Gain at a point (3,) [m]."""
        return float(self.weights(position) @ self.gains)

    def residual(self, position: Array, rate: int) -> Array:
        """Residual (s,) at a point (3,) [m] after 1 N s, sampled at `rate` [Hz]."""
        parts = [
            weight * resampled(residual, own, rate)
            for weight, residual, own in zip(self.weights(position), self.residuals, self.rates)
            if weight > 0.0
        ]
        sound = np.zeros(max(map(len, parts)))
        for part in parts:
            sound[: len(part)] += part
        return sound


def resampled(samples: Array, own: int, rate: int) -> Array:
    """Samples taken at the rate `own`, at another `rate`."""
    if own == rate or not len(samples):
        return samples
    from scipy.signal import resample_poly

    common = gcd(own, rate)
    return np.asarray(resample_poly(samples, rate // common, own // common))
