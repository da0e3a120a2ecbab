"""Objective of a design, Eq. (1) to (4), as sums of squares.

Two decisions make the amplitudes of Eq. (2) differentiable.  A mode has no sign, so magnitudes are
compared.  And modes of equal frequency have no shapes of their own, only a common span, so energies
are averaged within the width that the ear resolves, see `sound.design.resolved`.  The targets'
amplitudes are averaged likewise.

Eq. (2) leaves the first mode out, as Eq. (1) has to.  Here it counts like the others: otherwise it
would become too loud wherever that helps the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from carillon.arrays import Array
from solver.files.modes_file import frequencies
from sound.design.pitch import bark, bark_slope
from sound.design.resolved import (
    average,
    eigenvalue_slopes,
    heard_energies,
    heard_energy_slopes,
    struck_energies,
    struck_energy_slopes,
)

if TYPE_CHECKING:
    from sound.clips.targets import Targets
    from sound.design.sensitivity import Sensitivity
    from sound.project.settings import Weights
    from sound.radiation.transfer import Transfer


TINY = 1e-30


@dataclass(frozen=True)
class DesignCost:
    """Cost, Eq. (4), and its parts without their weights."""

    total: float
    frequency: float
    amplitude: float
    regulariser: float


class Objective:
    """Eq. (1) to (4) for N elastic modes and T struck points, with the weights w_f, w_a and w_r.

    `targets` are the modes that the points shall have; `shift` (T, N) is added to their balances of
    amplitudes. Frequencies are relative to the first partial, or as they are if `absolute`: those
    of a solid whose supports give it a scale of its own. Those of silent modes do not count.

    With `heard`, amplitudes are those in the direction of that transfer, and the rows of `pushed`
    go on with the products of its r patterns with the modes.
    """

    def __init__(
        self,
        targets: Targets,
        weights: Weights,
        shift: Array | None = None,
        absolute: bool = False,
        heard: Transfer | None = None,
    ) -> None:
        self.targets = targets
        self.weights = weights
        self.absolute = absolute
        self.heard = heard
        self._bark = bark(targets.frequencies)
        self._first = int(targets.sounding[0])
        self.compared = targets.sounding if absolute else targets.sounding[1:]
        """Numbers (p,) of the modes that have differences of frequency."""
        energies = average(targets.frequencies, targets.amplitudes**2)
        self._target = np.sqrt(energies / np.maximum(energies.max(axis=1, keepdims=True), TINY))
        if shift is not None:
            self._target = self._target + shift

    def frequency_residual(self, eigenvalues: Array) -> Array:
        """Bark differences (p,) of the modes that are `compared` (Eq. 1)."""
        return np.asarray(bark(self._scaled(eigenvalues)) - self._bark)[self.compared]

    def amplitude_residual(self, eigenvalues: Array, pushed: Array) -> Array:
        """Differences (T, N) of the balances (Eq. 2, and the first mode)."""
        return np.asarray(self.balance(eigenvalues, pushed) - self._target)

    def cost(self, eigenvalues: Array, pushed: Array, regulariser: float) -> DesignCost:
        """Eq. (4), from ascending elastic eigenvalues (N,) [rad^2/s^2], R, and u_k^T f (T, N)
        [kg^-1/2 N s] of unit impulses f along the inward normals, and of patterns if there are any.
        """
        frequency = 0.5 * float(np.sum(self.frequency_residual(eigenvalues) ** 2))
        amplitude = 0.5 * float(np.sum(self.amplitude_residual(eigenvalues, pushed) ** 2))
        w = self.weights
        total = w.frequency * frequency + w.amplitude * amplitude + w.regulariser * regulariser
        return DesignCost(total, frequency, amplitude, regulariser)

    def frequency_jacobian(self, eigenvalues: Array, sensitivity: Sensitivity) -> Array:
        """Derivatives (p, m) of `frequency_residual`."""
        scaled = self._scaled(eigenvalues)
        rows = (bark_slope(scaled) * scaled) * self._relative_slopes(eigenvalues, sensitivity)
        return np.asarray(rows.T[self.compared])

    def amplitude_jacobian(
        self, eigenvalues: Array, pushed: Array, sensitivity: Sensitivity
    ) -> Array:
        """Derivatives (T, N, m) of `amplitude_residual`."""
        energies = self._energies(eigenvalues, pushed)
        slopes = self._energy_slopes(eigenvalues, pushed, sensitivity)
        largest = energies.argmax(axis=1)
        points = np.arange(len(energies))
        peak = energies[points, largest][:, None]
        balance = np.sqrt(energies / peak)
        relative = slopes / np.maximum(energies, TINY * peak)[:, :, None]
        relative_peak = slopes[points, largest] / peak
        return np.asarray(0.5 * balance[:, :, None] * (relative - relative_peak[:, None, :]))

    def _scaled(self, eigenvalues: Array) -> Array:
        """s_f f_i with s_f = F_1 / f_1 of the first partial, or 1 if absolute."""
        if self.absolute:
            return frequencies(eigenvalues)
        first = self._first
        return np.asarray(
            self.targets.frequencies[first] * np.sqrt(eigenvalues / eigenvalues[first])
        )

    def balance(self, eigenvalues: Array, pushed: Array) -> Array:
        """Amplitudes (T, N) of modes over the loudest at each point; `cost` has the parameters."""
        energies = self._energies(eigenvalues, pushed)
        return np.asarray(np.sqrt(energies / energies.max(axis=1, keepdims=True)))

    def _energies(self, eigenvalues: Array, pushed: Array) -> Array:
        """Squared amplitudes (T, N)."""
        if self.heard is None:
            return struck_energies(eigenvalues, pushed[: len(self._target)])
        return heard_energies(eigenvalues, pushed, self._scaled(eigenvalues), self.heard)

    def _energy_slopes(self, eigenvalues: Array, pushed: Array, sensitivity: Sensitivity) -> Array:
        """Their derivatives (T, N, m)."""
        if self.heard is None:
            return struck_energy_slopes(eigenvalues, pushed[: len(self._target)], sensitivity)
        hertz = self._scaled(eigenvalues)
        relative = self._relative_slopes(eigenvalues, sensitivity)
        return heard_energy_slopes(eigenvalues, pushed, hertz, relative, sensitivity, self.heard)

    def _relative_slopes(self, eigenvalues: Array, sensitivity: Sensitivity) -> Array:
        """Derivatives (m, N) of the logarithms of the scaled frequencies."""
        relative = 0.5 * eigenvalue_slopes(eigenvalues, sensitivity) / eigenvalues
        return relative if self.absolute else relative - relative[:, self._first, None]


def fall(start: float, end: float) -> float:
    """Decrease of a cost over that at the start; 0 if that is 0."""
    return 1.0 - end / start if start > 0.0 else 0.0
