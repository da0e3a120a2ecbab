"""Transfer from the motion of a surface to the pressure in one direction, over a band.

The field on a surface at rest of a plane wave from the direction (phi of
`sound.radiation.boundary_elements`, J + S of `sound.radiation.sphere`) does not depend on how the
surface moves.  So it is found once for all materials of a solid.  Over a band of frequencies it is
a sum of few patterns.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from carillon.arrays import Array, Complex
from carillon.fem.model import Solid
from solver.response.points import interpolation

LEFT_OUT = 1e-4
"""Greatest share of a transfer's square that patterns leave out, at each frequency."""


@dataclass(frozen=True)
class Transfer:
    """Pressure times distance in one direction by the motion of a surface.

    A mode k whose coordinate moves at a velocity of the amplitude 1 kg^1/2 m/s moves the points of
    the surface outward by x_k (P,) [kg^-1/2].  It is heard with the amplitude |h_k|,

        h_k = sum_s c_s(omega_k) g_sk,    g_sk = patterns[:, s] . x_k .

    Modes of one frequency are heard with the sum of theirs: phases are relative to each other.

    Attributes
    ----------
    points, outward : (P, 3) [m], (P, 3)
        Points of the surface, and its normals there.
    patterns : (P, r) [1]
        Orthonormal.
    hertz, coefficients : (F,) [Hz], (F, r) [Pa m / (m/s)]
        c_s, complex, at ascending frequencies.
    """

    points: Array
    outward: Array
    patterns: Array
    hertz: Array
    coefficients: Complex

    @classmethod
    def of_fields(cls, points: Array, outward: Array, hertz: Array, fields: Complex) -> Transfer:
        """The transfer of fields (F, P) [Pa m / (m/s)] at frequencies (F,) [Hz]."""
        even = fields / np.linalg.norm(fields, axis=1, keepdims=True)
        rows = np.concatenate([even.real, even.imag])
        patterns = np.linalg.svd(rows, full_matrices=False)[2]
        held = np.cumsum(np.abs(even @ patterns.T) ** 2, axis=1).min(axis=0)
        count = int(np.searchsorted(held, 1.0 - LEFT_OUT)) + 1
        patterns = patterns[:count].T
        return cls(points, outward, patterns, hertz, fields @ patterns)

    def loads(self, model: Solid) -> Array:
        """Forces (n_dofs, r) on a model, whose products with its modes are g."""
        weights = interpolation(model, self.points)
        parts = [weights.T @ (self.outward[:, axis, None] * self.patterns) for axis in range(3)]
        return np.stack(parts, axis=1).reshape(-1, self.patterns.shape[1])

    def heard(self, model: Solid, modes: Array, hertz: Array) -> Complex:
        """h (N,) [Pa m / (kg^-1/2 N s)] of modes (n_dofs, N) at frequencies (N,) [Hz]."""
        return np.asarray((self.at(hertz) * (modes.T @ self.loads(model))).sum(axis=1))

    def covers(self, hertz: Array) -> bool:
        """Whether frequencies [Hz] are all in its band."""
        return bool(self.hertz[0] <= hertz.min() and hertz.max() <= self.hertz[-1])

    def at(self, hertz: Array) -> Complex:
        """c (N, r) at frequencies (N,) [Hz]; beyond the band those of its end."""
        return np.asarray(self._spline(self._inside(hertz)))

    def slopes(self, hertz: Array) -> Complex:
        """Derivatives (N, r) of `at` by the logarithm of the frequency, 0 beyond the band."""
        inside = (hertz > self.hertz[0]) & (hertz < self.hertz[-1])
        return np.asarray(self._spline(self._inside(hertz), 1) * (inside * hertz)[:, None])

    def _inside(self, hertz: Array) -> Array:
        return np.clip(hertz, self.hertz[0], self.hertz[-1])

    @cached_property
    def _spline(self) -> Any:
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.hertz, self.coefficients)
