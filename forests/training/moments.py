"""Sums over rows that a weighted linear regression needs, packed, and what they say.

With z = (x_1..x_7, 1, t) the sums are `sum w z z^T`, lower triangle by rows. They just add: over
rows, chunks, ranks, and up a tree.
"""

import numba
import numpy as np

from carillon.arrays import Array
from carillon.processes.threads import blas_threads
from forests.scaling import FEATURES

ONE, TARGET = FEATURES, FEATURES + 1
ENTRIES = (FEATURES + 2) * (FEATURES + 3) // 2

WEIGHT = ONE * (ONE + 1) // 2 + ONE
"""Entry that holds the sum of the weights."""
SIDE_BY_SIDE = 32
"""Fits whose errors are worked out together."""
RELATIVE_RIDGE = 1e-7
"""Ridge in units of a feature's own spread: enough where features are proportional."""
ROUNDING = 1e-10
"""Squared spread of a feature relative to its squared mean below which it counts as constant."""


@numba.njit(cache=True, nogil=True, inline="always")
def products(
    features: np.ndarray, target: float, weight: float, centre: Array, values: Array, sums: Array
) -> None:
    """Write `w z z^T` of one row (7,) to `sums` (45,), z taken from `centre` (8: features, t)."""
    for k in range(FEATURES):
        values[k] = features[k] - centre[k]
    values[ONE] = 1.0
    values[TARGET] = target - centre[FEATURES]
    entry = 0
    for i in range(FEATURES + 2):
        scaled = weight * values[i]
        for j in range(i + 1):
            sums[entry] = scaled * values[j]
            entry += 1


@numba.njit(cache=True, nogil=True)
def fit_errors(parts: Array) -> Array:
    """Weighted sums of squared residuals (n,) of linear fits from their sums (n, 45).

    The part of `sum w t^2` that a Cholesky factorisation of the features' scatter leaves. Fits are
    taken `SIDE_BY_SIDE`, each step for all of them, which a processor does several at a time.
    """
    errors = np.zeros(len(parts))
    sums = np.empty((ENTRIES, SIDE_BY_SIDE))
    square = np.empty((FEATURES, FEATURES, SIDE_BY_SIDE))
    right = np.empty((FEATURES, SIDE_BY_SIDE))
    inverse, mean, error = np.empty(SIDE_BY_SIDE), np.empty(SIDE_BY_SIDE), np.empty(SIDE_BY_SIDE)
    for first in range(0, len(parts), SIDE_BY_SIDE):
        here = min(SIDE_BY_SIDE, len(parts) - first)
        for p in range(SIDE_BY_SIDE):
            part = parts[first + min(p, here - 1)]
            for entry in range(ENTRIES):
                sums[entry, p] = part[entry]
        _scatter(sums, inverse, mean, error, square, right)
        _reduce(square, right, error)
        for p in range(here):
            errors[first + p] = max(error[p], 0.0) if inverse[p] > 0.0 else 0.0
    return errors


@numba.njit(cache=True, nogil=True)
def _scatter(
    sums: Array, inverse: Array, mean: Array, error: Array, square: Array, right: Array
) -> None:
    """Write the scatter of the features, and of them with the target, about their means."""
    target, ones = TARGET * (TARGET + 1) // 2, ONE * (ONE + 1) // 2
    lanes = range(SIDE_BY_SIDE)
    for p in lanes:
        inverse[p] = 1.0 / sums[WEIGHT, p] if sums[WEIGHT, p] > 0.0 else 0.0
        mean[p] = sums[target + ONE, p] * inverse[p]
        error[p] = sums[target + TARGET, p] - mean[p] * sums[target + ONE, p]
    for i in range(FEATURES):
        for j in range(i + 1):
            row = i * (i + 1) // 2 + j
            for p in lanes:
                outer = sums[ones + i, p] * sums[ones + j, p] * inverse[p]
                square[i, j, p] = sums[row, p] - outer
        for p in lanes:
            right[i, p] = sums[target + i, p] - sums[ones + i, p] * mean[p]
            centre = sums[ones + i, p] * inverse[p]
            constant = ROUNDING * sums[WEIGHT, p] * (1e-2 + centre * centre)
            square[i, i, p] += RELATIVE_RIDGE * square[i, i, p] + constant


@numba.njit(cache=True, nogil=True)
def _reduce(square: Array, right: Array, error: Array) -> None:
    """Take from the errors what the features explain.

    A feature whose scatter is of rounding errors only explains nothing.
    """
    lanes = range(SIDE_BY_SIDE)
    for i in range(FEATURES):
        for j in range(i):
            for k in range(j):
                for p in lanes:
                    square[i, j, p] -= square[i, k, p] * square[j, k, p]
            for p in lanes:
                square[i, j, p] *= square[j, j, p]
        for k in range(i):
            for p in lanes:
                square[i, i, p] -= square[i, k, p] * square[i, k, p]
                right[i, p] -= square[i, k, p] * right[k, p]
        for p in lanes:
            pivot = square[i, i, p]
            # The diagonal holds the inverse of the factor's.
            square[i, i, p] = 1.0 / np.sqrt(pivot) if pivot > 0.0 else 0.0
            right[i, p] *= square[i, i, p]
            error[p] -= right[i, p] * right[i, p]


@blas_threads(1)
def solve(sums: Array) -> Array:
    """Coefficients (n, 8) of weighted linear fits from their sums (n, 45): slopes, constant.

    A feature that is constant among the rows gets no slope.
    """
    rows, columns = np.tril_indices(FEATURES + 2)
    full = np.zeros((len(sums), FEATURES + 2, FEATURES + 2))
    full[:, rows, columns] = sums
    full[:, columns, rows] = sums
    total = np.maximum(sums[:, WEIGHT], np.finfo(float).tiny)
    mean = full[:, ONE, :FEATURES] / total[:, None]
    target = full[:, TARGET, ONE] / total
    outer = mean[:, :, None] * mean[:, None, :]
    scatter = full[:, :FEATURES, :FEATURES] - total[:, None, None] * outer
    cross = full[:, TARGET, :FEATURES] - (total * target)[:, None] * mean
    spread = np.maximum(np.einsum("nii->ni", scatter), 0.0)
    constant = spread <= ROUNDING * total[:, None] * (1e-2 + mean**2)
    cross[constant] = 0.0
    scatter[constant[:, :, None] | constant[:, None, :]] = 0.0
    ridge = np.where(constant, 1.0, RELATIVE_RIDGE * spread)
    scatter += ridge[:, :, None] * np.eye(FEATURES)
    slopes = np.linalg.solve(scatter, cross[..., None])[..., 0]
    return np.column_stack([slopes, target - (slopes * mean).sum(axis=1)])
