"""Averages of modes within the width that the ear resolves, and their derivatives.

Modes of equal frequency have no shapes of their own, only a common span, so energies are averaged,

    b_k = sum_i w((f_i - f_k) / f_k) a_i^2 / sum_i w((f_i - f_k) / f_k),   w a Gaussian,

which is a_k^2 for a mode on its own.  With h_k(lambda) the weight as a function of the eigenvalue,
the sum over i of h_k(lambda_i) a_i^2 is f^T U h_k(Lambda) U^T f.  Its derivative is that of a
function of a matrix: for modes close to each other divided differences of h_k stand where the
eigenvectors' derivatives would have differences of eigenvalues in their denominators, and stay
finite where these vanish.

At a place pressures add up, not energies.  Modes k of one frequency are heard there with

    e_k = |sum_i v_ki p_i h_ki|^2 / sum_i v_ki,   h_ki = sum_s c_s(omega_k) g_si,

where p_i = u_i^T f and g_si = u_i^T e_s are the products of the mode with the strike and with the
patterns of `sound.radiation.transfer`, and v is a narrower Gaussian.  For each s the sum is f^T U
v_k(Lambda) U^T e_s.  Beyond its width energies e_i are averaged as those of a_i^2 above.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from carillon.arrays import Array
from solver.subspace.weyl import clusters

if TYPE_CHECKING:
    from sound.design.sensitivity import Sensitivity
    from sound.radiation.transfer import Transfer

RESOLVED = 3e-3
"""Standard deviation of the average over neighbouring modes, over their frequency: about the least
difference of two tones that the ear resolves."""
ONE_TONE = 3e-4
"""The same of modes whose pressures add up: half a cent; beats of these outlast most decays."""
CLUSTER = 1e-6
"""Relative difference below which eigenvalues count as equal."""
EQUAL = 1e-9
"""Relative difference of eigenvalues below which a derivative replaces a divided difference."""


def average(frequencies: Array, energies: Array) -> Array:
    """b_k (T, N) of squared amplitudes (T, N)."""
    kernel = _kernel(frequencies, RESOLVED)
    return np.asarray(energies @ (kernel / kernel.sum(axis=1, keepdims=True)).T)


def struck_energies(eigenvalues: Array, pushed: Array) -> Array:
    """b_k (T, N) of u_k^T f (T, N)."""
    return average(np.sqrt(eigenvalues), pushed**2)


def struck_energy_slopes(eigenvalues: Array, pushed: Array, sensitivity: Sensitivity) -> Array:
    """Derivatives (T, N, m) of `struck_energies`."""
    weights = _Weights(eigenvalues, sensitivity, RESOLVED)
    slopes = []
    for a, moved in zip(pushed, sensitivity.outside.transpose(1, 2, 0)):
        total = weights.slopes(a, np.tile(a, (len(a), 1))) + 2.0 * (weights.kernel * a) @ moved
        slopes.append(weights.normalised(weights.kernel @ a**2, total))
    return np.array(slopes)


def heard_energies(eigenvalues: Array, pushed: Array, hertz: Array, transfer: Transfer) -> Array:
    """Squared amplitudes (T, N), heard at a place, of modes that sound at frequencies (N,) [Hz].

    The rows of `pushed` (T + r, N) are u_k^T f of the strikes, then g of the transfer.
    """
    struck, patterns = _parts(pushed, transfer)
    kernel = _kernel(np.sqrt(eigenvalues), ONE_TONE)
    sums = struck @ (kernel * (transfer.at(hertz) @ patterns)).T
    return average(np.sqrt(eigenvalues), np.abs(sums) ** 2 / kernel.sum(axis=1))


def heard_energy_slopes(
    eigenvalues: Array,
    pushed: Array,
    hertz: Array,
    relative: Array,
    sensitivity: Sensitivity,
    transfer: Transfer,
) -> Array:
    """Derivatives (T, N, m) of `heard_energies`; `relative` (m, N) are those of log(hertz)."""
    struck, patterns = _parts(pushed, transfer)
    tone = _Weights(eigenvalues, sensitivity, ONE_TONE)
    ear = _Weights(eigenvalues, sensitivity, RESOLVED)
    kernel, at = tone.kernel, transfer.at(hertz)
    heard, risen = at @ patterns, transfer.slopes(hertz) @ patterns
    moved = sensitivity.outside.transpose(1, 2, 0)
    slopes = []
    for p, dp in zip(struck, moved):
        sums = (kernel * heard) @ p
        # |z|^2 changes by 2 Re(conj(z) dz): with conj(z) taken in, all that follows is real.
        turned = 2.0 * np.conj(sums)[:, None]
        own, rising = (turned * heard).real, (turned * risen).real
        total = tone.slopes(p, own) + (kernel * own) @ dp
        total += ((kernel * rising) @ p)[:, None] * relative.T
        for factors, dg in zip((turned * at).real.T, moved[len(struck) :]):
            total += factors[:, None] * ((kernel * p) @ dg)
        square = np.abs(sums) ** 2
        energies = square / kernel.sum(axis=1)
        slopes.append(ear.averaged(energies, tone.normalised(square, total)))
    return np.array(slopes)


def _parts(pushed: Array, transfer: Transfer) -> tuple[Array, Array]:
    """Rows of the strikes, and those of the patterns."""
    strikes = len(pushed) - transfer.patterns.shape[1]
    return pushed[:strikes], pushed[strikes:]


class _Weights:
    """Weights (N k, N i) of mode i about mode k, of a relative width, and their derivatives."""

    def __init__(self, eigenvalues: Array, sensitivity: Sensitivity, width: float) -> None:
        frequencies = np.sqrt(eigenvalues)
        self.kernel = kernel = _kernel(frequencies, width)
        self._sensitivity = sensitivity
        self._values = eigenvalue_slopes(eigenvalues, sensitivity)
        ratio = frequencies[None, :] / frequencies[:, None]
        # Derivative of the weight (k, i) by eigenvalue i; that by k is opposite in scale.
        self._by_own = -kernel * (ratio - 1.0) * ratio / (2.0 * width**2 * eigenvalues[None, :])
        self._by_centre = -self._by_own * eigenvalues[None, :] / eigenvalues[:, None]
        i, j = sensitivity.pairs.T
        gaps = eigenvalues[i] - eigenvalues[j]
        equal = np.abs(gaps) <= EQUAL * eigenvalues[i]
        divided = (kernel[:, i] - kernel[:, j]) / np.where(equal, 1.0, gaps)
        self._divided = np.where(equal, 0.5 * (self._by_own[:, i] + self._by_own[:, j]), divided)

    def slopes(self, one: Array, other: Array) -> Array:
        """Derivatives (N, m) of sum_i w_ki x_i y_ki, x (N,) and y (N, N), by what stays in the
        span of close modes: by their turns, and by the centre of the average."""
        i, j = self._sensitivity.pairs.T
        products = one[i] * other[:, j] + np.where(i == j, 0.0, one[j] * other[:, i])
        turned = (self._divided * products) @ self._sensitivity.stiffness.T
        return np.asarray(turned + (self._by_centre * other) @ one[:, None] * self._values.T)

    def averaged(self, energies: Array, slopes: Array) -> Array:
        """Derivatives (N, m) of the average of energies (N,), from those of each."""
        moved = (self._by_own * energies) @ self._values.T
        moved += (self._by_centre @ energies)[:, None] * self._values.T
        return self.normalised(self.kernel @ energies, self.kernel @ slopes + moved)

    def normalised(self, sums: Array, slopes: Array) -> Array:
        """Derivatives (N, m) of sums (N,) over those of the weights, from the sums' own."""
        total = self.kernel.sum(axis=1)
        by_weights = self._by_own @ self._values.T
        by_weights += self._by_centre.sum(axis=1)[:, None] * self._values.T
        return np.asarray((slopes - (sums / total)[:, None] * by_weights) / total[:, None])


def _kernel(frequencies: Array, width: float) -> Array:
    """Weights (N k, N i) of mode i in the average around mode k, not normalised."""
    distance = frequencies[None, :] / frequencies[:, None] - 1.0
    return np.asarray(np.exp(-0.5 * (distance / width) ** 2))


def eigenvalue_slopes(eigenvalues: Array, sensitivity: Sensitivity) -> Array:
    """Derivatives (m, N) of the eigenvalues; equal eigenvalues have the mean of theirs.

    Equal eigenvalues have no derivatives one by one, as any change separates them.  Their mean has
    one; for a pair, central differences find it, too.
    """
    slopes = sensitivity.stiffness[:, : len(eigenvalues)].copy()
    for group in clusters(eigenvalues, CLUSTER):
        slopes[:, group] = slopes[:, group].mean(axis=1, keepdims=True)
    return np.asarray(slopes)
