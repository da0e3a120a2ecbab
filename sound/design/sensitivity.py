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

from carillon.fem.element import quadrature_stiffness
from solver.analysis.modal_solver import Modes
from solver.linear import Inverse

Array = NDArray[np.float64]
Index = NDArray[np.int64]

CELLS_AT_ONCE = 128
"""Cells whose strain energies exist together."""
STRAINS = 6
"""Rank of the stiffness of a quadrature point."""
SHIFT_FRACTION = 0.6
"""Fraction of the last eigenvalue above which a shift is sought."""
DEPENDENT = 1e-10
"""Share (squared) of a vector below which it lies in the space that it was made orthogonal to."""


def strain_factors(poisson: float) -> Array:
    """B (8, 6, 24) with K_q = B_q^T B_q: strains of an element of unit edge, weighted."""
    values, vectors = np.linalg.eigh(quadrature_stiffness(poisson))
    factors = np.sqrt(np.maximum(values, 0.0))[:, None, :] * vectors
    return np.ascontiguousarray(factors[:, :, -STRAINS:].transpose(0, 2, 1))


def projected_stiffness(
    corners: Index,
    strains: Array,
    vectors: Array,
    others: Array,
    slopes: Array,
) -> tuple[Array, Array]:
    """u_i^T (dK/dz) u_j, and u_i^T (dK/dz) x_i with vectors that belong to a mode.

    Parameters
    ----------
    corners : (c, 8)
        Nodes of the elements.
    strains : (8, 6, 24)
        Strain factors, the edge of an element included.
    vectors : (3 n, N)
        Modes u.
    others : (3 n, T, N)
        Vectors x, T of each mode.
    slopes : (8 c, m)
        Derivatives of the moduli at the quadrature points.

    Returns
    -------
    inside : (m, N, N)
        u_i^T (dK/dz) u_j.
    beyond : (m, T, N)
        u_i^T (dK/dz) x_i.
    """
    count, points = vectors.shape[1], others.shape[1]
    pairs = count * (count + 1) // 2
    total = np.zeros((slopes.shape[1], pairs + points * count))
    columns = np.ascontiguousarray(others.reshape(len(vectors), -1))
    for first in range(0, len(corners), CELLS_AT_ONCE):
        cells = corners[first : first + CELLS_AT_ONCE]
        energies = np.empty((8 * len(cells), total.shape[1]))
        _pair_energies(cells, strains, vectors, columns, energies)
        total += slopes[8 * first : 8 * (first + len(cells))].T @ energies
    upper = np.triu_indices(count)
    inside = np.empty((len(total), count, count))
    inside[:, upper[0], upper[1]] = inside[:, upper[1], upper[0]] = total[:, :pairs]
    return inside, total[:, pairs:].reshape(-1, points, count)


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
def _pair_energies(corners, strains, vectors, others, energies):  # type: ignore[no-untyped-def]
    """Energies (8 c, pairs) per unit of modulus, modes with modes and each with its others."""
    count = vectors.shape[1]
    points = others.shape[1] // count
    local = np.empty((24, count))
    local_others = np.empty((24, others.shape[1]))
    for cell in range(len(corners)):
        for a in range(8):
            node = corners[cell, a]
            local[3 * a : 3 * a + 3] = vectors[3 * node : 3 * node + 3]
            local_others[3 * a : 3 * a + 3] = others[3 * node : 3 * node + 3]
        for q in range(8):
            strain = strains[q] @ local
            strain_others = strains[q] @ local_others
            row = energies[8 * cell + q]
            pair = 0
            for i in range(count):
                row[pair : pair + count - i] = 0.0
                for s in range(6):
                    factor = strain[s, i]
                    for j in range(i, count):
                        row[pair + j - i] += factor * strain[s, j]
                pair += count - i
            for p in range(points):
                for i in range(count):
                    value = 0.0
                    for s in range(6):
                        value += strain[s, i] * strain_others[s, p * count + i]
                    row[pair + p * count + i] = value
