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
CLOSE = 0.2
"""Share of the largest distance to all eigenvalues from which another shift is as good."""
DEPENDENT = 1e-10
"""Share (squared) of a vector below which it lies in the space that it was made orthogonal to."""


def projected_stiffness(
    nodes: NDArray[np.integer],
    strains: Array,
    vectors: Array,
    others: Array,
    slopes: Array,
) -> tuple[Array, Array]:
    """u_i^T (dK/dz) u_j, and u_i^T (dK/dz) x_i with vectors that belong to a mode.

    Parameters
    ----------
    nodes : (c, k)
        Of the elements.
    strains : (p, 6, 3 k)
        See `sound.design.elements.AnalysedElements.strains`.
    vectors : (3 n, N)
        Modes u.
    others : (3 n, T, N)
        Vectors x, T of each mode.
    slopes : (p c, m)
        Derivatives of the moduli at the elements' points.

    Returns
    -------
    inside : (m, N, N)
        u_i^T (dK/dz) u_j.
    beyond : (m, T, N)
        u_i^T (dK/dz) x_i.
    """
    count, struck, points = vectors.shape[1], others.shape[1], len(strains)
    pairs = count * (count + 1) // 2
    total = np.zeros((slopes.shape[1], pairs + struck * count))
    columns = np.concatenate([vectors, others.reshape(len(vectors), -1)], axis=1)
    flat = np.ascontiguousarray(strains.reshape(-1, strains.shape[2]))
    at_once = max(1, POINTS_AT_ONCE // points)
    for first in range(0, len(nodes), at_once):
        cells = nodes[first : first + at_once]
        energies = np.empty((points * len(cells), total.shape[1]))
        _pair_energies(cells, flat, columns, count, energies)
        total += slopes[points * first : points * (first + len(cells))].T @ energies
    upper = np.triu_indices(count)
    inside = np.empty((len(total), count, count))
    inside[:, upper[0], upper[1]] = inside[:, upper[1], upper[0]] = total[:, :pairs]
    return inside, total[:, pairs:].reshape(-1, struck, count)


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
    system, struck = modes.system, pushes.shape[1]
    known = size = system.rigid.shape[1] + elastic.shape[1]
    whole, mass_whole = np.empty((2, len(pushes), known + MOST_BLOCKS * struck))
    whole[:, :known] = np.concatenate([system.rigid, elastic], axis=1)
    mass_whole[:, :known] = system.times_mass(whole[:, :known])
    free = pushes - mass_whole[:, :known] @ (whole[:, :known].T @ pushes)
    mass_block, stiffness = free, np.empty((0, 0))
    solution = np.zeros((0, struck * len(values)))
    for _ in range(MOST_BLOCKS):
        block = inverse.solve(np.ascontiguousarray(mass_block))
        mass_block, gram = _made_orthogonal(modes, block, whole[:, :size], mass_whole[:, :size])
        weights = _orthonormal(gram)
        if not weights.shape[1]:
            break
        block, mass_block = block @ weights, mass_block @ weights
        here = slice(size, size + weights.shape[1])
        whole[:, here], mass_whole[:, here] = block, mass_block
        size = here.stop
        basis = whole[:, known:size]
        stiffness = _bordered(stiffness, basis.T @ system.times_stiffness(block))
        before, solution = solution, _galerkin(stiffness, basis.T @ free, values)
        change = solution.copy()
        change[: len(before)] -= before
        if (la.norm(change, axis=0) <= accuracy * la.norm(solution, axis=0)).all():
            break
    return (whole[:, known:size] @ solution).reshape(len(pushes), struck, -1)


def _made_orthogonal(
    modes: Modes, block: Array, basis: Array, mass_basis: Array
) -> tuple[Array, Array]:
    """M times `block`, and its Gram matrix, once it is made orthogonal to `basis`, in place."""
    for _ in range(MOST_PASSES):
        overlap = mass_basis.T @ block
        block -= basis @ overlap
        mass_block = modes.system.times_mass(block)
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
    return SHIFTS[0] * values[-1] <= shift and _distance(values, shift) >= CLOSE * best


def _distance(values: Array, shift: float) -> float:
    return float(np.abs(values - shift).min())


def _orthonormal(gram: Array) -> Array:
    """Coefficients that make vectors with this Gram matrix orthonormal, dependent ones dropped."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(gram), np.finfo(float).tiny))
    spread, directions = np.linalg.eigh(gram * scale * scale[:, None])
    kept = spread > DEPENDENT
    return np.asarray(scale[:, None] * directions[:, kept] / np.sqrt(spread[kept]))


@numba.njit(cache=True, nogil=True, fastmath={"contract", "reassoc"}, error_model="numpy")
def _pair_energies(nodes, strains, columns, count, energies):  # type: ignore[no-untyped-def]
    """Energies (p c, pairs) per unit of modulus, modes with modes and each with its others.

    The first `count` columns are the modes, then come the others, point after point.
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
                own = strain[6 * q : 6 * q + 6, k * each : k * each + count]
                others = strain[6 * q : 6 * q + 6, k * each + count : (k + 1) * each]
                row = energies[points * (first + k) + q]
                pair = 0
                for i in range(count):
                    a0, a1, a2 = own[0, i], own[1, i], own[2, i]
                    a3, a4, a5 = own[3, i], own[4, i], own[5, i]
                    for j in range(i, count):
                        row[pair + j - i] = (
                            a0 * own[0, j]
                            + a1 * own[1, j]
                            + a2 * own[2, j]
                            + a3 * own[3, j]
                            + a4 * own[4, j]
                            + a5 * own[5, j]
                        )
                    pair += count - i
                for start in range(0, others.shape[1], count):
                    for i in range(count):
                        value = 0.0
                        for s in range(6):
                            value += own[s, i] * others[s, start + i]
                        row[pair + start + i] = value
