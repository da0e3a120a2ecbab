"""Contribution of modes that were not computed to the derivatives of mode shapes (appendix 2).

The appendix truncates it; here a Krylov space gives it.
"""

import numpy as np
import scipy.linalg as la

from carillon.arrays import Array
from solver.analysis.modes import Modes
from solver.linear import Inverse
from solver.subspace.orthonormal import swept, whitening

SHIFTS = (0.5, 0.75)
"""Least and greatest shift over the last computed eigenvalue.  A Krylov space about such a shift is
near to all computed eigenvalues, and the analysis of a similar material can use the inverse."""
MOST_BLOCKS = 16
"""Greatest number of blocks of a Krylov space."""
MOST_PASSES = 3
"""Greatest number of orthogonalisations of a block; two are enough but for rounding."""
EQUAL = 1e-10
"""Relative difference of eigenvalues below which they count as equal."""
CLEAR = 0.2
"""Least distance of a usable shift from all eigenvalues, over that of the best shift."""


def outside_response(
    modes: Modes, inverse: Inverse, elastic: Array, values: Array, pushes: Array, accuracy: float
) -> Array:
    """x (3 n, T, N), the sums of u_j (u_j^T f_p) / (lambda_k - lambda_j) over other modes j.

    They solve (K - lambda_k M) x = -f, without the part of f in the computed modes, and lie near
    one Krylov space of (K - mu M)^-1 M.  The result is the Galerkin solution in that space, made
    orthogonal to the computed modes and enlarged by blocks of T vectors until a block changes no
    solution by more than `accuracy`.

    Parameters
    ----------
    modes, inverse
        Modes of the analysis; (K - mu M)^-1 with mu between the eigenvalues, close to none.
    elastic, values : (3 n, N), (N,) [rad^2/s^2]
        Computed elastic modes, and their eigenvalues.
    pushes : (3 n, T)
        Forces f.
    """
    struck = pushes.shape[1]
    space = _Space(modes, elastic, MOST_BLOCKS * struck)
    free = block = space.free_of(pushes)
    solution = np.zeros((0, struck * len(values)))
    for _ in range(MOST_BLOCKS):
        block = space.add(inverse.solve(np.ascontiguousarray(block)))
        if not block.shape[1]:
            break
        before, solution = solution, _galerkin(space.stiffness, space.basis.T @ free, values)
        change = solution.copy()
        change[: len(before)] -= before
        if (la.norm(change, axis=0) <= accuracy * la.norm(solution, axis=0)).all():
            break
    return (space.basis @ solution).reshape(len(pushes), struck, -1)


class _Space:
    """Growing subspace of at most `room` vectors, orthogonal to the rigid motions and the computed
    modes.

    `stiffness` is V^T K V (m, m) with the orthonormal basis V.
    """

    def __init__(self, modes: Modes, elastic: Array, room: int) -> None:
        self._system = system = modes.system
        self._known = self._size = system.rigid.shape[1] + elastic.shape[1]
        self._vectors, self._mass_vectors = np.empty((2, len(elastic), self._known + room))
        known = np.concatenate([system.rigid, elastic], axis=1)
        self._vectors[:, : self._known] = known
        self._mass_vectors[:, : self._known] = system.times_mass(known)
        self.stiffness = np.empty((0, 0))

    @property
    def basis(self) -> Array:
        """V (3 n, m)."""
        return self._vectors[:, self._known : self._size]

    def free_of(self, forces: Array) -> Array:
        """Forces (3 n, T) without their parts in the subspace and in what it is orthogonal to."""
        vectors, mass_vectors = self._vectors[:, : self._size], self._mass_vectors[:, : self._size]
        return np.asarray(forces - mass_vectors @ (vectors.T @ forces))

    def add(self, block: Array) -> Array:
        """Enlarge the subspace by a block (3 n, b), which is overwritten; M times the new
        vectors."""
        mass_block, gram = swept(block, self._sweep, self._system.times_mass, MOST_PASSES)
        weights, _ = whitening(gram)
        block, mass_block = block @ weights, mass_block @ weights
        end = self._size + weights.shape[1]
        self._vectors[:, self._size : end] = block
        self._mass_vectors[:, self._size : end] = mass_block
        self._size = end
        last = self.basis.T @ self._system.times_stiffness(block)
        self.stiffness = _bordered(self.stiffness, last)
        return mass_block

    def _sweep(self, block: Array) -> Array:
        vectors, mass_vectors = self._vectors[:, : self._size], self._mass_vectors[:, : self._size]
        overlap = mass_vectors.T @ block
        block -= vectors @ overlap
        return np.asarray(overlap)


def _bordered(matrix: Array, last: Array) -> Array:
    """A symmetric matrix (m, m) with the columns `last` (m + b, b), and rows that mirror them."""
    size = len(matrix)
    whole = np.empty((len(last),) * 2)
    whole[:size, :size], whole[:, size:], whole[size:, :size] = matrix, last, last[:size].T
    return whole


def _galerkin(stiffness: Array, held: Array, values: Array) -> Array:
    """Solutions (m, T N) of (lambda_k - H) y = h in an orthonormal basis, H (m, m) and h (m, T)."""
    ritz, rotation = la.eigh(stiffness, check_finite=False)
    gaps = values[None, None, :] - ritz[:, None, None]
    # Of modes of one eigenvalue, of which some were computed, the others have no such part.
    apart = np.abs(gaps) > EQUAL * values
    weights = np.where(apart, (rotation.T @ held)[:, :, None] / np.where(apart, gaps, 1.0), 0.0)
    return np.asarray(rotation @ weights.reshape(len(ritz), -1))


def shift_between(values: Array) -> float:
    """The shift in the range of `SHIFTS` that is farthest from all eigenvalues (N,)."""
    ends = values[-1] * np.array(SHIFTS)
    middles = 0.5 * (values[1:] + values[:-1])
    possible = np.concatenate([ends, middles[(middles > ends[0]) & (middles < ends[1])]])
    distances = [_distance(values, each) for each in possible]
    return float(possible[np.argmax(distances)])


def lies_between(values: Array, shift: float) -> bool:
    """Whether a shift is nearly as far from all eigenvalues (N,) as that of `shift_between`."""
    best = _distance(values, shift_between(values))
    return SHIFTS[0] * values[-1] <= shift and _distance(values, shift) >= CLEAR * best


def _distance(values: Array, shift: float) -> float:
    return float(np.abs(values - shift).min())
