"""Derivatives of eigenpairs through the coarsening and the reduced material (appendix 2).

With M-orthonormal modes, d lambda_k = u_k^T dK u_k and the derivative of u_k is the sum over all
other modes j of u_j (u_j^T dK u_k) / (lambda_k - lambda_j).  The computed modes enter as they are;
what the others add is found in a Krylov space, where the appendix leaves it out.
"""

from __future__ import annotations

import numba
import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from solver.analysis.modes import Modes
from solver.linear import Inverse
from solver.subspace.orthonormal import is_cancelled

Array = NDArray[np.float64]
Index = NDArray[np.int64]

POINTS_AT_ONCE = 1024
"""Points of elements whose strain energies exist together."""
CELLS_AT_ONCE = 8
"""Elements whose strains do."""
SHIFTS = (0.5, 0.75)
"""Range of a shift, as shares of the last eigenvalue: with it among the computed ones a Krylov
space is near to all of them, and an analysis of a similar material can use the inverse, too."""
MOST_BLOCKS = 16
"""Blocks of a Krylov space at most."""
MOST_PASSES = 3
"""Times that a block is made orthogonal; twice is enough but for rounding."""
CLEAR = 0.2
"""Share of the largest distance to all eigenvalues from which another shift is as good."""
CLOSE = 1e-2
"""Relative difference of eigenvalues up to which modes are close to each other."""
DEPENDENT = 1e-10
"""Share (squared) of a vector below which it lies in the space that it was made orthogonal to."""


def projected_stiffness(
    nodes: NDArray[np.integer],
    strains: Array,
    vectors: Array,
    pairs: Index,
    others: Array,
    slopes: Array,
) -> tuple[Array, Array]:
    """u_i^T (dK/dz) u_j of some pairs, and u_i^T (dK/dz) x_i with vectors that belong to a mode.

    Parameters
    ----------
    nodes : (c, k)
        Of the elements.
    strains : (p, 6, 3 k)
        See `sound.design.elements.AnalysedElements.strains`.
    vectors : (3 n, N)
        Modes u.
    pairs : (P, 2)
        Numbers i and j, see `close_pairs`.
    others : (3 n, T, N)
        Vectors x, T of each mode.
    slopes : (p c, m)
        Derivatives of the moduli at the elements' points.

    Returns
    -------
    inside : (m, P)
        u_i^T (dK/dz) u_j.
    beyond : (m, T, N)
        u_i^T (dK/dz) x_i.
    """
    count, struck, points = vectors.shape[1], others.shape[1], len(strains)
    total = np.zeros((slopes.shape[1], len(pairs) + struck * count))
    columns = np.concatenate([vectors, others.reshape(len(vectors), -1)], axis=1)
    flat = np.ascontiguousarray(strains.reshape(-1, strains.shape[2]))
    at_once = max(1, POINTS_AT_ONCE // points)
    for first in range(0, len(nodes), at_once):
        cells = nodes[first : first + at_once]
        energies = np.empty((points * len(cells), total.shape[1]))
        _pair_energies(cells, flat, columns, pairs, count, energies)
        total += slopes[points * first : points * (first + len(cells))].T @ energies
    return total[:, : len(pairs)], total[:, len(pairs) :].reshape(-1, struck, count)


def close_pairs(values: Array) -> Index:
    """Numbers (P, 2) of eigenvalues (N,) that differ by `CLOSE` at most, first each with itself."""
    own = np.arange(len(values))
    i, j = np.triu_indices(len(values), 1)
    close = _are_close(values[i], values[j])
    return np.concatenate([np.stack([own, own], 1), np.stack([i[close], j[close]], 1)])


def inside_response(elastic: Array, values: Array, pushed: Array) -> Array:
    """x (3 n, T, N) with x_pk = sum of u_j (u_j^T f_p) / (lambda_k - lambda_j) over the computed.

    Modes close to k are left out.

    Parameters
    ----------
    elastic : (3 n, N)
        Modes u.
    values : (N,) [rad^2/s^2]
        Their eigenvalues.
    pushed : (T, N)
        u_j^T f_p.
    """
    other, own = values[:, None], values[None, :]
    close = _are_close(other, own)
    inverse = np.where(close, 0.0, 1.0 / np.where(close, 1.0, own - other))
    weights = pushed.T[:, :, None] * inverse[:, None, :]
    return np.asarray(
        (elastic @ weights.reshape(len(values), -1)).reshape(len(elastic), *weights.shape[1:])
    )


def _are_close(one: Array, other: Array) -> NDArray[np.bool_]:
    return np.asarray(np.abs(one - other) <= CLOSE * np.maximum(one, other))


def outside_response(
    modes: Modes, inverse: Inverse, elastic: Array, values: Array, pushes: Array, accuracy: float
) -> Array:
    """x (3 n, T, N) with x_pk = sum of u_j (u_j^T f_p) / (lambda_k - lambda_j) over other modes.

    These are all solutions of (K - lambda_k M) x = -f, without the part of f that the computed
    modes hold, and all lie near one Krylov space of (K - mu M)^-1 M: of its blocks of T vectors,
    made orthogonal to the computed modes, the Galerkin solutions are taken, with as many blocks as
    it takes until one more changes no solution by more than `accuracy`.

    Parameters
    ----------
    modes
        Of the analysis.
    inverse
        (K - mu M)^-1 with mu between the eigenvalues, not close to one.
    elastic : (3 n, N)
        The computed modes but for the rigid ones.
    values : (N,) [rad^2/s^2]
        Their eigenvalues.
    pushes : (3 n, T)
        Forces f.
    accuracy : float
        Largest relative change by the last block.
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
    """Growing subspace, orthogonal to the rigid motions and the computed modes.

    Parameters
    ----------
    modes
        Of the analysis.
    elastic
        Those but the rigid ones.
    room
        Vectors that it may grow to.

    Attributes
    ----------
    stiffness
        V^T K V (m, m) with the orthonormal basis V.
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
        """Forces (3 n, T) less the part that the subspace, and what it is orthogonal to, hold."""
        vectors, mass_vectors = self._vectors[:, : self._size], self._mass_vectors[:, : self._size]
        return np.asarray(forces - mass_vectors @ (vectors.T @ forces))

    def add(self, block: Array) -> Array:
        """Let the subspace grow by a block (3 n, b), which is lost; M times what it added."""
        mass_block, gram = self._made_orthogonal(block)
        weights = _orthonormal(gram)
        block, mass_block = block @ weights, mass_block @ weights
        end = self._size + weights.shape[1]
        self._vectors[:, self._size : end] = block
        self._mass_vectors[:, self._size : end] = mass_block
        self._size = end
        last = self.basis.T @ self._system.times_stiffness(block)
        self.stiffness = _bordered(self.stiffness, last)
        return mass_block

    def _made_orthogonal(self, block: Array) -> tuple[Array, Array]:
        """M times `block`, and its Gram matrix, once it is made orthogonal to all, in place."""
        vectors, mass_vectors = self._vectors[:, : self._size], self._mass_vectors[:, : self._size]
        for _ in range(MOST_PASSES):
            overlap = mass_vectors.T @ block
            block -= vectors @ overlap
            mass_block = self._system.times_mass(block)
            gram = block.T @ mass_block
            if not is_cancelled(gram, overlap):
                break
        return mass_block, gram


def _bordered(matrix: Array, last: Array) -> Array:
    """A symmetric matrix (m, m) with the columns `last` (m + b, b), and rows that mirror them."""
    size = len(matrix)
    whole = np.empty((len(last),) * 2)
    whole[:size, :size], whole[:, size:], whole[size:, :size] = matrix, last, last[:size].T
    return whole


def _galerkin(stiffness: Array, held: Array, values: Array) -> Array:
    """Solutions (m, T N) of (lambda_k - H) y = h in an orthonormal basis, H (m, m) and h (m, T)."""
    ritz, rotation = la.eigh(stiffness, check_finite=False)
    weights = (rotation.T @ held)[:, :, None] / (values[None, None, :] - ritz[:, None, None])
    return np.asarray(rotation @ weights.reshape(len(ritz), -1))


def shift_between(values: Array) -> float:
    """The shift in the range of `SHIFTS` that is farthest from all of the eigenvalues (N,)."""
    ends = values[-1] * np.array(SHIFTS)
    middles = 0.5 * (values[1:] + values[:-1])
    possible = np.concatenate([ends, middles[(middles > ends[0]) & (middles < ends[1])]])
    distances = [_distance(values, each) for each in possible]
    return float(possible[np.argmax(distances)])


def lies_between(values: Array, shift: float) -> bool:
    """Whether a shift is hardly closer to an eigenvalue of (N,) than that of `shift_between`."""
    best = _distance(values, shift_between(values))
    return SHIFTS[0] * values[-1] <= shift and _distance(values, shift) >= CLEAR * best


def _distance(values: Array, shift: float) -> float:
    return float(np.abs(values - shift).min())


def _orthonormal(gram: Array) -> Array:
    """Coefficients that make vectors with this Gram matrix orthonormal, dependent ones dropped."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(gram), np.finfo(float).tiny))
    spread, directions = np.linalg.eigh(gram * scale * scale[:, None])
    kept = spread > DEPENDENT
    return np.asarray(scale[:, None] * directions[:, kept] / np.sqrt(spread[kept]))


@numba.njit(cache=True, nogil=True, fastmath={"contract", "reassoc"}, error_model="numpy")
def _pair_energies(nodes, strains, columns, pairs, count, energies):  # type: ignore[no-untyped-def]
    """Energies (p c, P + T N) per unit of modulus: of pairs of modes, and of each with its others.

    The first `count` columns are the modes, then come the others, point after point; the first
    `count` pairs are those of a mode with itself.
    """
    width, points = nodes.shape[1], len(strains) // 6
    each = columns.shape[1]
    # Many columns at once, as few of them do not keep BLAS busy.
    local = np.empty((3 * width, CELLS_AT_ONCE * each))
    strain = np.empty((len(strains), CELLS_AT_ONCE * each))
    for first in range(0, len(nodes), CELLS_AT_ONCE):
        cells = nodes[first : first + CELLS_AT_ONCE]
        for k in range(len(cells)):
            for a in range(width):
                node = cells[k, a]
                for i in range(3):
                    local[3 * a + i, k * each : (k + 1) * each] = columns[3 * node + i]
        np.dot(strains, local, strain)
        for k in range(len(cells)):
            for q in range(points):
                own = strain[6 * q : 6 * q + 6, k * each : (k + 1) * each]
                row = energies[points * (first + k) + q]
                _products(own, 0, count, row, 0)
                for pair in range(count, len(pairs)):
                    i, j = pairs[pair]
                    value = 0.0
                    for s in range(6):
                        value += own[s, i] * own[s, j]
                    row[pair] = value
                for start in range(count, each, count):
                    _products(own, start, count, row, len(pairs) + start - count)


@numba.njit(cache=True, nogil=True, fastmath={"contract", "reassoc"}, error_model="numpy")
def _products(strain, start, count, row, place):  # type: ignore[no-untyped-def]
    """Of the first columns of strains (6, k), each with that as far from `start` on."""
    s0, s1, s2, s3, s4, s5 = strain[0], strain[1], strain[2], strain[3], strain[4], strain[5]
    for i in range(count):
        j = start + i
        row[place + i] = (
            s0[i] * s0[j]
            + s1[i] * s1[j]
            + s2[i] * s2[j]
            + s3[i] * s3[j]
            + s4[i] * s4[j]
            + s5[i] * s5[j]
        )
