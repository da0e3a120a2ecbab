"""Loudness and noise of a strike anywhere on the surface, from the clips of a design."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array, Complex
from sound.clips.targets import Targets
from sound.levels import faded
from sound.project.design import Design
from sound.rendering.clip_level import clip_level, resampled
from sound.rendering.solid import SoundingSolid

BEGIN_SECONDS = 2.5e-4
"""Time in which a clip's noise begins: with the clip's own modes it begins from rest, but not with
those of a solid, which have other phases."""


@dataclass(frozen=True)
class Listening:
    """Loudness and noise of a design's clips at the struck points, at positions (T, 3) [m].

    A clip counts as the sound of 1 N s along the inward normal.  The gain (T,) [kg^1/2 N^-1 s^-1]
    of its point, samples of full scale per amplitude, makes such a strike as loud as the clip, and
    so does the factor `noise_gains` (T,) on the clip's noise, see `sound.rendering.clip_level`.
    Elsewhere gains and noise are averages weighted by the inverse square of the distance.  Only the
    noise of a residual is heard: partials that were missed belong to the clip, not to the material.

    `targets` are those of the clips, and `energies` (T,) those of the clips' modes: squared samples
    summed over all time.  `heard` (k,) [Pa m / (kg^-1/2 N s)] are the pressures of the modes where
    the design sounds as its clips, None where it is struck; amplitudes are in Pa m then.
    """

    positions: Array
    gains: Array
    noise_gains: Array
    targets: Targets
    energies: Array
    heard: Complex | None = None

    @classmethod
    def of_design(cls, design: Design, solid: SoundingSolid) -> Listening:
        """Gains of a solid's modes at the struck points of a design, and the clips' noise."""
        targets = design.targets
        positions = np.array([strike.position for strike in design.strikes])
        inward = np.array([strike.inward for strike in design.strikes])
        amplitudes = solid.amplitudes(positions, inward)
        level = clip_level(targets, solid.frequencies, solid.dampings, amplitudes)
        squares = (targets.amplitudes**2 / (4.0 * targets.dampings)).sum(axis=1)
        energies = np.array(targets.rates) * squares
        return cls(positions, level.gains, level.noise, targets, energies, solid.heard)

    @property
    def missed(self) -> Array:
        """Shares (T,) of the clips' energies in tones of the residuals, which are not heard."""
        rests = np.array([rest @ rest for rest in self.targets.residuals])
        lacking = np.array([share for _, share in self.targets.noises]) * rests
        whole = self.energies + rests
        return np.asarray(np.divide(lacking, whole, out=np.zeros_like(whole), where=whole > 0.0))

    def weights(self, position: Array) -> Array:
        """Weights (T,) of the struck points at a point (3,) [m]; 1 for the point itself."""
        return near_weights(self.positions, position)

    def gain(self, position: Array) -> float:
        """Gain at a point (3,) [m]."""
        return float(self.weights(position) @ self.gains)

    def clip_seconds(self, position: Array) -> float | None:
        """Length of the clips at a point (3,) [m], over which it is as loud as these [s]."""
        loudness = self.targets.loudness
        return None if loudness is None else float(self.weights(position) @ loudness.seconds)

    def noise(self, rate: int) -> list[Array]:
        """T residuals (s,) without their tones, after 1 N s, at the sampling rate `rate` [Hz].

        They begin within `BEGIN_SECONDS`.
        """
        parts = zip(self.noise_gains, self.targets.noises, self.targets.rates)
        return [_begun(gain * resampled(noise, own, rate), rate) for gain, (noise, _), own in parts]


def _begun(noise: Array, rate: int) -> Array:
    """Noise (s,) that begins from 0 by half a cosine."""
    return faded(noise[::-1], rate, BEGIN_SECONDS)[0][::-1]


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
