"""Eight unknowns, bounded below: the small least-squares problem at the end of every linear fit."""

import numpy as np

from carillon.arrays import Array, Flags
from carillon.numerics.simd import (
    LANES,
    Vector,
    empty,
    larger,
    load,
    root,
    spread,
    store,
    where_less,
)
from dataset_gen.objectives.compiled import compiled

EXCHANGES = 12
"""Exchanges of all wrong unknowns at once before the slow method that cannot cycle takes over."""
MAX_ITERATIONS = 200
"""Unknowns that enter in the slow method; eight are usual."""
TOLERANCE = 1e-12
"""Slope that counts as zero, as a share of the largest right-hand side."""


@compiled
def solve_free(matrix: Array, vector: Array, free: Array, factor: Array, x: Array) -> None:
    """Solution x (8) of the equations of the free unknowns by Cholesky; zero elsewhere.

    All are arrays of lanes; `free` is 1 or 0. Not a number where the matrix (8, 8) is not positive.
    """
    one = spread(1.0)
    for i in range(8):
        total = load(vector, i) * load(free, i)
        for j in range(i):
            entry = load(matrix, 8 * i + j) * load(free, i) * load(free, j)
            for k in range(j):
                entry = entry - load(factor, 8 * i + k) * load(factor, 8 * j + k)
            entry = entry * load(factor, 9 * j)
            store(factor, 8 * i + j, entry)
            total = total - entry * load(x, j)
        pivot = load(matrix, 9 * i) * load(free, i) + (one - load(free, i))
        for k in range(i):
            pivot = pivot - load(factor, 8 * i + k) * load(factor, 8 * i + k)
        pivot = one / root(pivot)
        store(factor, 9 * i, pivot)
        store(x, i, total * pivot)
    for i in range(7, -1, -1):
        total = load(x, i)
        for k in range(i + 1, 8):
            total = total - load(factor, 8 * k + i) * load(x, k)
        store(x, i, total * load(factor, 9 * i))


@compiled
def _exchange(matrix: Array, vector: Array, tolerance: Vector, free: Array, x: Array) -> Vector:
    """Hold free unknowns below zero, free held ones that would grow; how many in each lane."""
    zero, one = spread(0.0), spread(1.0)
    changes = zero
    for i in range(8):
        slope = load(vector, i)
        for j in range(8):
            slope = slope - load(matrix, 8 * i + j) * load(x, j)
        kept = where_less(zero, load(x, i), one, zero)
        entering = where_less(tolerance, slope, one, zero)
        now = where_less(zero, load(free, i), kept, entering)
        changes = changes + (now - load(free, i)) * (now - load(free, i))
        store(free, i, now)
    return changes


@compiled
def _grow(matrix: Array, vector: Array, work: tuple[Array, Array, Array], lane: int) -> bool:
    """Minimiser of one lane by the active sets of Lawson and Hanson; whether it settled.

    `work` is the free unknowns, room for a factor, and the trial that becomes the minimiser.
    """
    free, factor, trial = work
    x = np.zeros(8)
    tolerance = 0.0
    for i in range(8):
        free[i, lane] = 0.0
        tolerance = max(tolerance, TOLERANCE * abs(vector[i, lane]))
    for _ in range(MAX_ITERATIONS):
        best, entering = tolerance, -1
        for i in range(8):
            slope = vector[i, lane]
            for j in range(8):
                slope -= matrix[8 * i + j, lane] * x[j]
            if free[i, lane] == 0.0 and slope > best:
                best, entering = slope, i
        if entering < 0:
            for i in range(8):
                trial[i, lane] = x[i]
            return True
        free[entering, lane] = 1.0
        leaving = 0
        while leaving >= 0:
            solve_free(matrix, vector, free, factor, trial)
            step, leaving = 1.0, -1
            for i in range(8):
                if free[i, lane] > 0.0 and trial[i, lane] <= 0.0:
                    ratio = x[i] / (x[i] - trial[i, lane]) if x[i] > trial[i, lane] else 0.0
                    if ratio <= step:
                        step, leaving = ratio, i
            for i in range(8):
                x[i] += step * (trial[i, lane] - x[i])
            if leaving >= 0:
                free[leaving, lane] = 0.0
                x[leaving] = 0.0
    return False


@compiled
def _minimise(matrix: Array, vector: Array, x: Array, settled: Flags) -> None:
    """Non-negative minimisers x (8) of the problems in the lanes."""
    free, factor, other, changes = empty(8), empty(64), empty(8), empty(1)
    largest = spread(0.0)
    for i in range(8):
        store(free, i, spread(1.0))
        largest = larger(largest, larger(load(vector, i), spread(0.0) - load(vector, i)))
    for _ in range(EXCHANGES):
        solve_free(matrix, vector, free, factor, x)
        store(changes, 0, _exchange(matrix, vector, largest * spread(TOLERANCE), free, x))
        if changes.max() == 0.0:
            break
    for lane in range(LANES):
        settled[lane] = changes[0, lane] == 0.0
        if not settled[lane]:
            settled[lane] = _grow(matrix, vector, (free, factor, other), lane)
            for i in range(8):
                x[i, lane] = other[i, lane]


@compiled
def minimise_above(matrices: Array, vectors: Array, lower: Array) -> tuple[Array, Flags]:
    """Minimise `x^T A x / 2 - b^T x` subject to `x >= lower`, one problem per row.

    Parameters
    ----------
    matrices : (n, 8, 8)
        Symmetric positive definite A.
    vectors : (n, 8)
        Right-hand sides b.
    lower : (n,)
        Lower bound common to a row's unknowns.

    Returns
    -------
    (n, 8)
        Minimisers.
    (n,) bool
        Whether the active set settled.
    """
    count = len(vectors)
    solutions = np.empty((count, 8))
    settled = np.empty(count, dtype=np.bool_)
    matrix, vector, x = empty(64), empty(8), empty(8)
    done = np.empty(LANES, dtype=np.bool_)
    for first in range(0, count, LANES):
        for lane in range(LANES):
            row = min(first + lane, count - 1)
            for i in range(8):
                total = vectors[row, i]
                for j in range(8):
                    matrix[8 * i + j, lane] = matrices[row, i, j]
                    total -= lower[row] * matrices[row, i, j]
                vector[i, lane] = total
        _minimise(matrix, vector, x, done)
        for lane in range(min(LANES, count - first)):
            row = first + lane
            settled[row] = done[lane]
            for i in range(8):
                solutions[row, i] = x[i, lane] + lower[row]
                settled[row] &= np.isfinite(x[i, lane])
    return solutions, settled
