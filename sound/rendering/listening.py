"""Loudness and noise of a strike anywhere on the surface, from the clips of a design."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import gcd

import numpy as np

from carillon.arrays import Array
from sound.clips.noise import noise_part
from sound.project.design import Design
from sound.rendering.solid import SoundingSolid


@dataclass(frozen=True)
class Listening:
    """Loudness and noise of a design's clips at the struck points, at positions (T, 3) [m].

    A clip counts as the sound of 1 N s along the inward normal.  The gain (T,) [kg^1/2 N^-1 s^-1]
    of its point, samples of full scale per amplitude, makes the loudest mode there as loud as the
    clip's, as Eq. 2 compares them.  Elsewhere gains and noise are averages weighted by the inverse
    square of the distance.  Only the noise of a residual is heard: partials that were missed belong
    to the clip, not to the material.

    `residuals` are T arrays (s,) at `rates` [Hz], the clips without their modes, and `energies`
    (T,) those of the clips' modes: squared samples summed over all time.
    """

    positions: Array
    gains: Array
    residuals: tuple[Array, ...]
    rates: tuple[int, ...]
    energies: Array

    @classmethod
    def of_design(cls, design: Design, solid: SoundingSolid) -> Listening:
        """Gains of a solid's modes at the struck points of a design, and the clips' residuals."""
        targets = design.targets
        positions = np.array([strike.position for strike in design.strikes])
        inward = np.array([strike.inward for strike in design.strikes])
        loudest = solid.amplitudes(positions, inward).max(axis=1)
        gains = targets.amplitudes.max(axis=1) / loudest
        squares = (targets.amplitudes**2 / (4.0 * targets.dampings)).sum(axis=1)
        energies = np.array(targets.rates) * squares
        return cls(positions, gains, targets.residuals, targets.rates, energies)

    @cached_property
    def _noise(self) -> list[tuple[Array, float]]:
        return [noise_part(rest, rate) for rest, rate in zip(self.residuals, self.rates)]

    @property
    def missed(self) -> Array:
        """Shares (T,) of the clips' energies in tones of the residuals, which are not heard."""
        rests = np.array([rest @ rest for rest in self.residuals])
        lacking = np.array([share for _, share in self._noise]) * rests
        whole = self.energies + rests
        return np.asarray(np.divide(lacking, whole, out=np.zeros_like(whole), where=whole > 0.0))

    def weights(self, position: Array) -> Array:
        """Weights (T,) of the struck points at a point (3,) [m]; 1 for the point itself."""
        return near_weights(self.positions, position)

    def gain(self, position: Array) -> float:
        """Gain at a point (3,) [m]."""
        return float(self.weights(position) @ self.gains)

    def noise(self, rate: int) -> list[Array]:
        """T residuals (s,) without their tones, after 1 N s, at the sampling rate `rate` [Hz]."""
        return [resampled(noise, own, rate) for (noise, _), own in zip(self._noise, self.rates)]


def near_weights(points: Array, positions: Array) -> Array:
    """Weights (..., T) of points (T, 3) at positions (..., 3), as the inverse square of distances.

    Examples
    --------
    >>> near_weights(np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]]), np.array([1.0, 0.0, 0.0]))
    array([0.8, 0.2])
    """
    square = ((points - positions[..., None, :]) ** 2).sum(axis=-1)
    nearest = square.min(axis=-1, keepdims=True)
    at = square == 0.0
    inverse = np.where(nearest == 0.0, at, nearest / np.where(at, 1.0, square))
    return np.asarray(inverse / inverse.sum(axis=-1, keepdims=True))


def resampled(samples: Array, own: int, rate: int) -> Array:
    """Samples resampled from the rate `own` to `rate`."""
    if own == rate or not len(samples):
        return samples
    from scipy.signal import resample_poly

    common = gcd(own, rate)
    return np.asarray(resample_poly(samples, rate // common, own // common))
