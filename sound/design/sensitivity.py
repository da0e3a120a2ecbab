"""Derivatives of eigenpairs through the coarsening and the reduced material (appendix 2).

With M-orthonormal modes, d lambda_k = u_k^T dK u_k, and the derivative of u_k is the sum over all
other modes j of u_j (u_j^T dK u_k) / (lambda_k - lambda_j).  For a pushed mode f^T u_k that is one
product u_k^T dK x_k, with x_k the sum of u_j (u_j^T f) / (lambda_k - lambda_j).  Modes close to k
would have tiny denominators; they are left out of x_k, and their products u_i^T dK u_j are computed
one by one.  `modal_truncation` adds the modes that were not computed.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array, Index

POINTS_AT_ONCE = 1024
"""Number of elements' points whose strain energies are held in memory together."""
CELLS_AT_ONCE = 8
"""Number of elements whose strains are held in memory together."""
CLOSE = 1e-2
"""Greatest relative difference of the eigenvalues of close modes."""


@dataclass(frozen=True)
class Sensitivity:
    """Derivatives of eigenpairs by m coordinates, projected on pairs of modes and on forces.

    `pairs` (P, 2) are numbers i <= j of elastic modes of close eigenvalues, first all with i = j,
    and `stiffness` (m, P) [rad^2/s^2] is u_i^T (dK/dz) u_j of these.  `outside` (m, R, N) is the
    part of the derivative of each product of a force and a mode outside of the modes close to it.
    """

    pairs: Index
    stiffness: Array
    outside: Array


class LawElements(NamedTuple):
    """Elements as far as they are of one elasticity."""

    nodes: NDArray[np.integer]
    strains: Array
    """(c, k) nodes of the elements; (p, 6, 3 k), see
    `sound.design.elements.AnalysedElements.strains`."""
    slopes: Array
    """(p c, m) derivatives of the moduli at the elements' points."""


def projected_stiffness(
    parts: Iterable[LawElements], vectors: Array, pairs: Index, others: Array, coordinates: int
) -> tuple[Array, Array]:
    """u_i^T (dK/dz) u_j (m, P) of pairs of modes, and u_i^T (dK/dz) x_i (m, T, N) with vectors x.

    Parameters
    ----------
    parts
        Elements of the solid.
    vectors, pairs : (3 n, N), (P, 2)
        Modes u, and their numbers i and j, see `close_pairs`.
    others : (3 n, T, N)
        Vectors x, T for each mode.
    coordinates
        Their number m.
    """
    count, struck = vectors.shape[1], others.shape[1]
    total = np.zeros((coordinates, len(pairs) + struck * count))
    columns = np.concatenate([vectors, others.reshape(len(vectors), -1)], axis=1)
    for nodes, strains, slopes in parts:
        points = len(strains)
        for first, energies in _energies_by_point(nodes, strains, columns, pairs, count):
            total += slopes[points * first : points * first + len(energies)].T @ energies
    return total[:, : len(pairs)], total[:, len(pairs) :].reshape(len(total), struck, count)


def energies_of_cells(
    nodes: NDArray[np.integer], strains: Array, vectors: Array, pairs: Index, others: Array
) -> Array:
    """Products (c, P + T N) of cells, the sums over p of their matrices B (p, 6, 3 k), `strains`:
    (B u_i)^T B u_j of pairs of modes, then (B u_i)^T B x_i.

    `nodes` (c, k) are those of the cells, `projected_stiffness` has the other parameters.
    """
    count = vectors.shape[1]
    columns = np.concatenate([vectors, others.reshape(len(vectors), -1)], axis=1)
    found = np.empty((len(nodes), len(pairs) + columns.shape[1] - count))
    for first, energies in _energies_by_point(nodes, strains, columns, pairs, count):
        by_cell = energies.reshape(-1, len(strains), energies.shape[1]).sum(axis=1)
        found[first : first + len(by_cell)] = by_cell
    return found


def _energies_by_point(
    nodes: NDArray[np.integer], strains: Array, columns: Array, pairs: Index, count: int
) -> Iterator[tuple[int, Array]]:
    """For some cells after others the first one's number, and energies (p c, P + T N) at points.

    The first `count` columns are the modes.
    """
    points = len(strains)
    flat = np.ascontiguousarray(strains.reshape(-1, strains.shape[2]))
    at_once = max(1, POINTS_AT_ONCE // points)
    for first in range(0, len(nodes), at_once):
        cells = nodes[first : first + at_once]
        energies = np.empty((points * len(cells), len(pairs) + columns.shape[1] - count))
        _pair_energies(cells, flat, columns, pairs, count, energies)
        yield first, energies


def close_pairs(values: Array) -> Index:
    """Numbers (P, 2) of eigenvalues (N,) that differ by `CLOSE` at most, first each with itself."""
    pairs = all_pairs(len(values))
    return np.asarray(pairs[_are_close(values[pairs[:, 0]], values[pairs[:, 1]])])


def all_pairs(count: int) -> Index:
    """Numbers (P, 2) of pairs of `count` modes, first each with itself."""
    own = np.arange(count)
    return np.concatenate([np.stack([own, own], 1), np.stack(np.triu_indices(count, 1), 1)])


def inside_response(elastic: Array, values: Array, pushed: Array) -> Array:
    """x (3 n, T, N), the sums of u_j (u_j^T f_p) / (lambda_k - lambda_j) over computed modes j.

    `elastic` (3 n, N) are the modes u, `values` (N,) [rad^2/s^2] their eigenvalues, and `pushed`
    (T, N) is u_j^T f_p.  Modes close to k are left out.
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


@numba.njit(cache=True, nogil=True, fastmath={"contract", "reassoc"}, error_model="numpy")
def _pair_energies(nodes, strains, columns, pairs, count, energies):  # type: ignore[no-untyped-def]
    """Energies (p c, P + T N) per unit of modulus: of pairs of modes, and of each with its others.

    The first `count` columns are the modes, then come the others, point after point; the first
    `count` pairs are those of a mode with itself.
    """
    width, points = nodes.shape[1], len(strains) // 6
    each = columns.shape[1]
    # Many columns at once, as BLAS is slow for few.
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
    """Products of the first columns of strains (6, k) with those from `start` on."""
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
