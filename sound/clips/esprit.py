"""Exponents of damped sinusoids in a short complex signal, by ESPRIT; their number, by ESTER."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import scipy.linalg as la

from carillon.arrays import Complex

MOST = 40
"""Greatest number of exponents of one signal."""
_ESTER_FRACTION = 0.02
"""Least criterion of the number of sinusoids, over its maximum."""


def esprit(signal: Complex) -> Complex:
    """Exponents (p,) per sample of the damped sinusoids in `signal` (n,).

    The leading left singular vectors of the signal's Hankel matrix span what exp(lambda_k n) span,
    so that shifting them by a sample multiplies them by a matrix with eigenvalues exp(lambda_k)
    (Roy and Kailath 1989), which is found by total least squares.
    """
    vectors = _subspace(signal)
    return _exponents(vectors[:, : ester(vectors)])


def exponents_of_orders(signal: Complex, orders: Iterable[int]) -> list[Complex]:
    """Exponents (p,) of damped sinusoids in `signal` for each of some numbers p."""
    vectors = _subspace(signal)
    return [_exponents(vectors[:, :order]) for order in orders]


def _exponents(vectors: Complex) -> Complex:
    poles = la.eigvals(_rotation(vectors))
    return np.log(poles[np.abs(poles) > 0.0])


def ester(vectors: Complex) -> int:
    """Number of sinusoids: the largest order whose subspace hardly changes under a shift.

    The criterion of Badeau, David and Richard (2006): J(p) is the inverse square of the norm of
    what least squares leaves of the shift of the first p vectors; here it is the Frobenius norm,
    which needs no decomposition for each order.  J is largest at the number of sinusoids, or of the
    strong ones among them; the last order within a fiftieth of the maximum counts, as too many do
    less harm than too few.
    """
    across = vectors[:-1].conj().T @ vectors[1:]
    first, last = np.abs(vectors[0]) ** 2, np.abs(vectors[-1]) ** 2
    orders = np.arange(1, len(across) + 1)
    # As the vectors are orthonormal, their products without the first or the last row differ from
    # the identity by one of rank 1.
    explained = np.diag((np.abs(across) ** 2).cumsum(0).cumsum(1))
    rank_one = np.diag((np.abs((vectors[-1][:, None] * across).cumsum(0)) ** 2).cumsum(1))
    lost = np.maximum(1.0 - np.cumsum(last), np.finfo(float).eps)
    squares = orders - np.cumsum(first) - explained - rank_one / lost
    criterion = 1.0 / np.maximum(squares, np.finfo(float).eps)
    return int(orders[criterion >= _ESTER_FRACTION * criterion.max()][-1])


def _subspace(signal: Complex) -> Complex:
    rows = len(signal) // 3
    most = min(MOST, rows - 2)
    covariance = _covariance(signal, rows)
    vectors = la.eigh(covariance, subset_by_index=(rows - most, rows - 1))[1]
    return np.asarray(vectors[:, ::-1])


def _covariance(signal: Complex, rows: int) -> Complex:
    """Hankel matrix (rows, columns) of a signal times its own adjoint.

    An entry differs from the one up and left of it by what the rows lose and gain at their ends.
    """
    columns = len(signal) - rows + 1
    change = np.outer(signal[columns:], signal[columns:].conj())
    change -= np.outer(signal[: rows - 1], signal[: rows - 1].conj())
    matrix = np.empty((rows, rows), complex)
    matrix[0] = np.lib.stride_tricks.sliding_window_view(signal, columns).conj() @ signal[:columns]
    matrix[:, 0] = matrix[0].conj()
    for row in range(1, rows):
        matrix[row, 1:] = matrix[row - 1, :-1] + change[row - 1]
    return matrix


def _rotation(vectors: Complex) -> Complex:
    """Matrix F that makes vectors[:-1] F = vectors[1:], by total least squares."""
    order = vectors.shape[1]
    right = la.svd(np.hstack([vectors[:-1], vectors[1:]]), full_matrices=False)[2].conj().T
    upper, lower = right[:order, order:], right[order:, order:]
    return np.asarray(-upper @ la.pinv(lower))
