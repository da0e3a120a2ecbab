"""Eight unknowns, bounded below: the small least-squares problem at the end of every linear fit."""

from __future__ import annotations

import numba
import numpy as np

from dataset_gen.element import Array

MAX_ITERATIONS = 200


@numba.njit(cache=True, nogil=True)
def _solve_free(matrix: Array, vector: Array, free: np.ndarray) -> Array:
    """Solution of the principal sub-system of the free unknowns by Cholesky; zero elsewhere."""
    index = np.flatnonzero(free)
    size = len(index)
    factor = np.zeros((size, size))
    solution = np.zeros(size)
    for i in range(size):
        for j in range(i + 1):
            total = matrix[index[i], index[j]]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            factor[i, j] = np.sqrt(total) if i == j else total / factor[j, j]
        total = vector[index[i]]
        for k in range(i):
            total -= factor[i, k] * solution[k]
        solution[i] = total / factor[i, i]
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            solution[i] -= factor[k, i] * solution[k]
        solution[i] /= factor[i, i]
    full = np.zeros(len(vector))
    full[index] = solution
    return full


@numba.njit(cache=True, nogil=True)
def _active_set(matrix: Array, vector: Array) -> tuple[Array, bool]:
    """Non-negative minimiser of x^T A x / 2 - b^T x by Lawson and Hanson's active sets."""
    size = len(vector)
    free = np.zeros(size, dtype=np.bool_)
    x = np.zeros(size)
    tolerance = 1e-12 * np.abs(vector).max()
    for _ in range(MAX_ITERATIONS):
        gradient = vector - matrix @ x
        entering = -1
        best = tolerance
        for i in range(size):
            if not free[i] and gradient[i] > best:
                best, entering = gradient[i], i
        if entering < 0:
            return x, True
        free[entering] = True
        while True:
            trial = _solve_free(matrix, vector, free)
            step = 1.0
            leaving = -1
            for i in range(size):
                if free[i] and trial[i] <= 0.0:
                    ratio = x[i] / (x[i] - trial[i]) if x[i] > trial[i] else 0.0
                    if ratio <= step:
                        step, leaving = ratio, i
            if leaving < 0:
                x = trial
                break
            x += step * (trial - x)
            free[leaving] = False
            x[leaving] = 0.0
    return x, False


@numba.njit(cache=True, nogil=True)
def minimise_above(matrices: Array, vectors: Array, lower: Array) -> tuple[Array, np.ndarray]:
    """Minimise `x^T A x / 2 - b^T x` subject to `x >= lower`, one problem per row.

    Parameters
    ----------
    matrices : (n, 8, 8) symmetric positive definite A.
    vectors : (n, 8) right-hand sides b.
    lower : (n,) lower bound common to a row's unknowns.

    Returns
    -------
    (n, 8) minimisers and (n,) flags: whether the active set settled.
    """
    count = len(vectors)
    solutions = np.empty_like(vectors)
    settled = np.empty(count, dtype=np.bool_)
    for row in range(count):
        matrix = matrices[row]
        shifted = vectors[row] - lower[row] * matrix.sum(axis=1)
        excess, settled[row] = _active_set(matrix, shifted)
        solutions[row] = excess + lower[row]
    return solutions, settled
