"""How far a solid sounds from its targets: Eq. (1) to (4), as sums of squares.

Two decisions make the amplitudes of Eq. (2) functions that have derivatives.  A mode has no sign,
so magnitudes are compared.  And modes of one frequency have no shapes of their own, only their span
has: what a strike excites within the width that the ear resolves is averaged,

    b_k = sum_i w((f_i - f_k) / f_k) a_i^2 / sum_i w((f_i - f_k) / f_k),   w a Gaussian,

which for a mode on its own is a_k^2.  The targets' amplitudes are averaged likewise.

Eq. (2) leaves the first mode out, as Eq. (1) has to.  Here it counts as the others: it would
otherwise be as loud as the loudest wherever that is of use to them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.subspace.spectrum import clusters
from sound.design.bark import bark, bark_slope

if TYPE_CHECKING:
    from sound.clips.targets import Targets
    from sound.project.project import Weights

Array = NDArray[np.float64]
Index = NDArray[np.int64]

RESOLVED = 3e-3
"""Standard deviation of the average over neighbouring modes, as a share of their frequency: about
the difference of two tones that the ear just tells apart."""
CLUSTER = 1e-6
"""Relative difference of eigenvalues below which they are taken for equal."""
EQUAL = 1e-9
"""The same, below which a divided difference is a derivative."""
TINY = 1e-30


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives of eigenpairs with respect to m coordinates, projected where they are needed.

    Attributes
    ----------
    pairs : (P, 2)
        Numbers i <= j of elastic modes that are close to each other, first all with i = j.
    stiffness : (m, P) [rad^2/s^2]
        u_i^T (dK/dz) u_j of these.
    outside : (m, T, N)
        Part of the derivative of each pushed mode that lies outside the modes close to it.
    """

    pairs: Index
    stiffness: Array
    outside: Array


@dataclass(frozen=True)
class DesignCost:
    """Value of Eq. (4) and its parts, each without its weight."""

    total: float
    frequency: float
    amplitude: float
    regulariser: float


class Objective:
    """Eq. (1) to (4) for N elastic modes and T struck points.

    Parameters
    ----------
    targets
        What the points shall sound like.
    weights
        w_f, w_a and w_r.
    shift : (T, N)
        Added to the targets' balances of amplitudes, none if not given.
    """

    def __init__(self, targets: Targets, weights: Weights, shift: Array | None = None) -> None:
        self.targets = targets
        self.weights = weights
        self._bark = bark(targets.frequencies)
        energies = _average(targets.frequencies, targets.amplitudes**2)
        self._target = np.sqrt(energies / np.maximum(energies.max(axis=1, keepdims=True), TINY))
        if shift is not None:
            self._target = self._target + shift

    def frequency_residual(self, eigenvalues: Array) -> Array:
        """Bark differences (N - 1,) of the second mode to the last (Eq. 1)."""
        return np.asarray(bark(self._scaled(eigenvalues)) - self._bark)[1:]

    def amplitude_residual(self, eigenvalues: Array, pushed: Array) -> Array:
        """Differences (T, N) of the balances (Eq. 2, and the first mode)."""
        return np.asarray(self.balance(eigenvalues, pushed) - self._target)

    def cost(self, eigenvalues: Array, pushed: Array, regulariser: float) -> DesignCost:
        """Eq. (4).

        Parameters
        ----------
        eigenvalues : (N,) [rad^2/s^2]
            Of the elastic modes, ascending.
        pushed : (T, N) [kg^-1/2 N s]
            u_k^T f of a unit impulse f along the inward normals.
        regulariser : float
            R.
        """
        frequency = 0.5 * float(np.sum(self.frequency_residual(eigenvalues) ** 2))
        amplitude = 0.5 * float(np.sum(self.amplitude_residual(eigenvalues, pushed) ** 2))
        w = self.weights
        total = w.frequency * frequency + w.amplitude * amplitude + w.regulariser * regulariser
        return DesignCost(total, frequency, amplitude, regulariser)

    def frequency_jacobian(self, eigenvalues: Array, sensitivity: Sensitivity) -> Array:
        """Derivatives (N - 1, m) of `frequency_residual`."""
        scaled = self._scaled(eigenvalues)
        relative = 0.5 * _slopes(eigenvalues, sensitivity) / eigenvalues
        rows = (bark_slope(scaled) * scaled) * (relative - relative[:, :1])
        return np.asarray(rows.T[1:])

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
        """s_f f_i with s_f = F_1 / f_1."""
        return np.asarray(self.targets.frequencies[0] * np.sqrt(eigenvalues / eigenvalues[0]))

    def balance(self, eigenvalues: Array, pushed: Array) -> Array:
        """Amplitudes (T, N) of modes as shares of the loudest at each point, see `cost`."""
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
    """Derivatives (m, N) of the eigenvalues; those of equal ones share their mean.

    Equal eigenvalues part in any direction and have no derivatives one by one.  The mean is that of
    a change that keeps them together; of a pair, it is what central differences find.
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
        # The centre of the average moves, and so does the sum that divides it.
        moved = (by_centre @ a**2)[:, None] * values.T
        lost = energies[point][:, None] * (by_own @ values.T + by_centre.sum(1)[:, None] * values.T)
        slopes[point] = (slopes[point] + moved - lost) / total[:, None]
    return energies, slopes


def fall(start: float, end: float) -> float:
    """Share of the cost at the start that was taken off; none where there was nothing."""
    return 1.0 - end / start if start > 0.0 else 0.0
