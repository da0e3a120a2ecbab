"""Sums over rows that a weighted linear regression needs, packed, and what they say.

With z = (x_1..x_7, 1, t) the sums are `sum w z z^T`, lower triangle by rows. They just add: over
rows, chunks, ranks, and up a tree.
"""

import numba
import numpy as np

from carillon.arrays import Array
from forests.scaling import FEATURES

ONE, TARGET = FEATURES, FEATURES + 1
ENTRIES = (FEATURES + 2) * (FEATURES + 3) // 2

WEIGHT = ONE * (ONE + 1) // 2 + ONE
"""Entry that holds the sum of the weights."""
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

    The part of `sum w t^2` that a Cholesky factorisation of the features' scatter leaves. A loop
    over many, and not a function of one: its unrolled body is long to compile at every call.
    """
    errors = np.zeros(len(parts))
    square, right = np.empty((FEATURES, FEATURES)), np.empty(FEATURES)
    for part in range(len(parts)):
        sums = parts[part]
        total = sums[WEIGHT]
        if total <= 0.0:
            continue
        target = TARGET * (TARGET + 1) // 2
        ones = ONE * (ONE + 1) // 2
        mean = sums[target + ONE] / total
        error = sums[target + TARGET] - mean * sums[target + ONE]
        for i in range(FEATURES):
            for j in range(i + 1):
                outer = sums[ones + i] * sums[ones + j] / total
                square[i, j] = sums[i * (i + 1) // 2 + j] - outer
            right[i] = sums[target + i] - sums[ones + i] * mean
            centre = sums[ones + i] / total
            constant = ROUNDING * total * (1e-2 + centre * centre)
            square[i, i] += RELATIVE_RIDGE * square[i, i] + constant
        for i in range(FEATURES):
            for j in range(i):
                value = square[i, j]
                for k in range(j):
                    value -= square[i, k] * square[j, k]
                square[i, j] = value / square[j, j]
            pivot = square[i, i]
            for k in range(i):
                pivot -= square[i, k] * square[i, k]
                right[i] -= square[i, k] * right[k]
            if pivot <= 0.0:
                # Scatter of rounding errors only: the feature explains nothing.
                square[i, i] = np.inf
                right[i] = 0.0
                continue
            square[i, i] = np.sqrt(pivot)
            right[i] /= square[i, i]
            error -= right[i] * right[i]
        errors[part] = max(error, 0.0)
    return errors


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
