"""Objective of a design, Eq. (1) to (4), as sums of squares.

Two decisions make the amplitudes of Eq. (2) differentiable.  A mode has no sign, so magnitudes are
compared.  And modes of equal frequency have no shapes of their own, only a common span, so energies
are averaged within the width that the ear resolves,

    b_k = sum_i w((f_i - f_k) / f_k) a_i^2 / sum_i w((f_i - f_k) / f_k),   w a Gaussian,

which is a_k^2 for a mode on its own.  The targets' amplitudes are averaged likewise.

Eq. (2) leaves the first mode out, as Eq. (1) has to.  Here it counts like the others: otherwise it
would become too loud wherever that helps the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from carillon.arrays import Array, Index
from solver.files.modes_file import frequencies
from solver.subspace.weyl import clusters
from sound.design.pitch import bark, bark_slope

if TYPE_CHECKING:
    from sound.clips.targets import Targets
    from sound.project.settings import Weights


RESOLVED = 3e-3
"""Standard deviation of the average over neighbouring modes, over their frequency: about the least
difference of two tones that the ear resolves."""
CLUSTER = 1e-6
"""Relative difference below which eigenvalues count as equal."""
EQUAL = 1e-9
"""Relative difference of eigenvalues below which a derivative replaces a divided difference."""
TINY = 1e-30


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives of eigenpairs by m coordinates, projected on pairs of modes and struck points.

    `pairs` (P, 2) are numbers i <= j of elastic modes of close eigenvalues, first all with i = j,
    and `stiffness` (m, P) [rad^2/s^2] is u_i^T (dK/dz) u_j of these.  `outside` (m, T, N) is the
    part of the derivative of each pushed mode outside of the modes close to it.
    """

    pairs: Index
    stiffness: Array
    outside: Array


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
    """

    def __init__(
        self,
        targets: Targets,
        weights: Weights,
        shift: Array | None = None,
        absolute: bool = False,
    ) -> None:
        self.targets = targets
        self.weights = weights
        self.absolute = absolute
        self._bark = bark(targets.frequencies)
        self._first = int(targets.sounding[0])
        self.compared = targets.sounding if absolute else targets.sounding[1:]
        """Numbers (p,) of the modes that have differences of frequency."""
        energies = _average(targets.frequencies, targets.amplitudes**2)
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
        [kg^-1/2 N s] of unit impulses f along the inward normals.
        """
        frequency = 0.5 * float(np.sum(self.frequency_residual(eigenvalues) ** 2))
        amplitude = 0.5 * float(np.sum(self.amplitude_residual(eigenvalues, pushed) ** 2))
        w = self.weights
        total = w.frequency * frequency + w.amplitude * amplitude + w.regulariser * regulariser
        return DesignCost(total, frequency, amplitude, regulariser)

    def frequency_jacobian(self, eigenvalues: Array, sensitivity: Sensitivity) -> Array:
        """Derivatives (p, m) of `frequency_residual`."""
        scaled = self._scaled(eigenvalues)
        relative = 0.5 * _slopes(eigenvalues, sensitivity) / eigenvalues
        if not self.absolute:
            relative = relative - relative[:, self._first, None]
        rows = (bark_slope(scaled) * scaled) * relative
        return np.asarray(rows.T[self.compared])

    def amplitude_jacobian(
        self, eigenvalues: Array, pushed: Array, sensitivity: Sensitivity
    ) -> Array:
        """Derivatives (T, N, m) of `amplitude_residual`."""
        energies, slopes = _average_slopes(eigenvalues, pushed, sensitivity)
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
        energies = _average(np.sqrt(eigenvalues), pushed**2)
        return np.asarray(np.sqrt(energies / energies.max(axis=1, keepdims=True)))


def _kernel(frequencies: Array) -> Array:
    """Weights (N k, N i) of mode i in the average around mode k, not normalised."""
    distance = frequencies[None, :] / frequencies[:, None] - 1.0
    return np.asarray(np.exp(-0.5 * (distance / RESOLVED) ** 2))


def _average(frequencies: Array, energies: Array) -> Array:
    """b_k (T, N) of squared amplitudes (T, N)."""
    kernel = _kernel(frequencies)
    return np.asarray(energies @ (kernel / kernel.sum(axis=1, keepdims=True)).T)


def _slopes(eigenvalues: Array, sensitivity: Sensitivity) -> Array:
    """Derivatives (m, N) of the eigenvalues; equal eigenvalues have the mean of theirs.

    Equal eigenvalues have no derivatives one by one, as any change separates them.  Their mean has
    one; for a pair, central differences find it, too.
    """
    slopes = sensitivity.stiffness[:, : len(eigenvalues)].copy()
    for group in clusters(eigenvalues, CLUSTER):
        slopes[:, group] = slopes[:, group].mean(axis=1, keepdims=True)
    return np.asarray(slopes)


def _average_slopes(
    eigenvalues: Array, pushed: Array, sensitivity: Sensitivity
) -> tuple[Array, Array]:
    """b_k (T, N) and its derivatives (T, N, m).

    With h_k(lambda) the kernel as a function of the eigenvalue, the sum over i of h_k(lambda_i)
    a_i^2 is f^T U h_k(Lambda) U^T f.  Its derivative is that of a function of a matrix: for modes
    close to each other divided differences of h_k stand where the eigenvectors' derivatives would
    have differences of eigenvalues in their denominators, and stay finite where these vanish.
    """
    frequencies = np.sqrt(eigenvalues)
    kernel = _kernel(frequencies)
    total = kernel.sum(axis=1)
    energies = pushed**2 @ kernel.T / total
    ratio = frequencies[None, :] / frequencies[:, None]
    # Derivative of the kernel (k, i) with respect to eigenvalue i; that to k is opposite in scale.
    by_own = -kernel * (ratio - 1.0) * ratio / (2.0 * RESOLVED**2 * eigenvalues[None, :])
    by_centre = -by_own * eigenvalues[None, :] / eigenvalues[:, None]
    i, j = sensitivity.pairs.T
    gaps = eigenvalues[i] - eigenvalues[j]
    equal = np.abs(gaps) <= EQUAL * eigenvalues[i]
    divided = (kernel[:, i] - kernel[:, j]) / np.where(equal, 1.0, gaps)
    divided = np.where(equal, 0.5 * (by_own[:, i] + by_own[:, j]), divided)
    divided *= np.where(i == j, 1.0, 2.0)
    values = _slopes(eigenvalues, sensitivity)
    m, count = values.shape
    slopes = np.empty((len(pushed), count, m))
    for point, a in enumerate(pushed):
        slopes[point] = (divided * (a[i] * a[j])) @ sensitivity.stiffness.T
        slopes[point] += (2.0 * kernel * a) @ sensitivity.outside[:, point].T
        # The centre of the average depends on z, too, and so does its sum of weights.
        moved = (by_centre @ a**2)[:, None] * values.T
        lost = energies[point][:, None] * (by_own @ values.T + by_centre.sum(1)[:, None] * values.T)
        slopes[point] = (slopes[point] + moved - lost) / total[:, None]
    return energies, slopes


def fall(start: float, end: float) -> float:
    """Decrease of a cost over that at the start; 0 if that is 0."""
    return 1.0 - end / start if start > 0.0 else 0.0
