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

from solver.analysis.modal_solver import Modes
from solver.linear import Inverse

Array = NDArray[np.float64]
Index = NDArray[np.int64]

POINTS_AT_ONCE = 1024
"""Points of elements whose strain energies exist together."""
SHIFT_FRACTION = 0.6
"""Fraction of the last eigenvalue above which a shift is sought."""
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
    columns = np.ascontiguousarray(others.reshape(len(vectors), -1))
    flat = np.ascontiguousarray(strains.reshape(-1, strains.shape[2]))
    at_once = max(1, POINTS_AT_ONCE // points)
    for first in range(0, len(nodes), at_once):
        cells = nodes[first : first + at_once]
        energies = np.empty((points * len(cells), total.shape[1]))
        _pair_energies(cells, flat, vectors, columns, energies)
        total += slopes[points * first : points * (first + len(cells))].T @ energies
    upper = np.triu_indices(count)
    inside = np.empty((len(total), count, count))
    inside[:, upper[0], upper[1]] = inside[:, upper[1], upper[0]] = total[:, :pairs]
    return inside, total[:, pairs:].reshape(-1, struck, count)


def outside_response(
    modes: Modes, inverse: Inverse, elastic: Array, values: Array, pushes: Array, blocks: int
) -> Array:
    """x (3 n, T, N) with x_pk = sum of u_j (u_j^T f_p) / (lambda_k - lambda_j) over other modes.

    These are all solutions of (K - lambda_k M) x = -f, without the part of f that the computed
    modes hold, and all lie near one Krylov space of (K - mu M)^-1 M: of its `blocks` blocks of T
    vectors, made orthogonal to the computed modes, the Galerkin solutions are taken.

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
    blocks : int
        Of the Krylov space.
    """
    system = modes.system
    known = np.concatenate([system.rigid, elastic], axis=1)
    mass_known = system.times_mass(known)
    free = pushes - mass_known @ (known.T @ pushes)
    basis = np.empty((len(pushes), 0))
    block = free
    for _ in range(blocks):
        block = inverse.solve(np.ascontiguousarray(block))
        for _ in range(2):
            block -= known @ (mass_known.T @ block)
            block -= basis @ (basis.T @ system.times_mass(block))
        block = _orthonormal(block, system.times_mass(block))
        if not block.shape[1]:
            break
        basis = np.concatenate([basis, block], axis=1)
        block = system.times_mass(block)
    ritz, rotation = la.eigh(basis.T @ system.times_stiffness(basis))
    basis = basis @ rotation
    held = basis.T @ free
    weights = held[:, :, None] / (values[None, None, :] - ritz[:, None, None])
    solution = basis @ weights.reshape(len(ritz), -1)
    return solution.reshape(len(pushes), pushes.shape[1], -1)


def shift_between(values: Array) -> float:
    """A shift in the widest gap of the eigenvalues (N,) above `SHIFT_FRACTION` of the last one."""
    top = values[values >= SHIFT_FRACTION * values[-1]]
    if len(top) < 2:
        return float(SHIFT_FRACTION * values[-1])
    gap = int(np.argmax(np.diff(top)))
    return float(0.5 * (top[gap] + top[gap + 1]))


def _orthonormal(block: Array, mass_block: Array) -> Array:
    """M-orthonormal columns that span `block`, dependent ones dropped."""
    gram = block.T @ mass_block
    scale = 1.0 / np.sqrt(np.maximum(np.diag(gram), np.finfo(float).tiny))
    spread, directions = np.linalg.eigh(gram * scale * scale[:, None])
    kept = spread > DEPENDENT
    return np.asarray(block @ (scale[:, None] * directions[:, kept] / np.sqrt(spread[kept])))


@numba.njit(cache=True, nogil=True, fastmath={"contract", "reassoc"}, error_model="numpy")
def _pair_energies(nodes, strains, vectors, others, energies):  # type: ignore[no-untyped-def]
    """Energies (p c, pairs) per unit of modulus, modes with modes and each with its others."""
    count = vectors.shape[1]
    struck = others.shape[1] // count
    width, points = nodes.shape[1], len(strains) // 6
    local = np.empty((3 * width, count))
    local_others = np.empty((3 * width, others.shape[1]))
    for cell in range(len(nodes)):
        for a in range(width):
            node = nodes[cell, a]
            local[3 * a : 3 * a + 3] = vectors[3 * node : 3 * node + 3]
            local_others[3 * a : 3 * a + 3] = others[3 * node : 3 * node + 3]
        strain = strains @ local
        strain_others = strains @ local_others
        for q in range(points):
            row = energies[points * cell + q]
            pair = 0
            for i in range(count):
                row[pair : pair + count - i] = 0.0
                for s in range(6 * q, 6 * q + 6):
                    factor = strain[s, i]
                    for j in range(i, count):
                        row[pair + j - i] += factor * strain[s, j]
                pair += count - i
            for p in range(struck):
                for i in range(count):
                    value = 0.0
                    for s in range(6 * q, 6 * q + 6):
                        value += strain[s, i] * strain_others[s, p * count + i]
                    row[pair + p * count + i] = value
