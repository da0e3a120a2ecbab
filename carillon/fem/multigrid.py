"""Inverse of the cells' Laplacian: conjugate gradients with a V-cycle on ever coarser graphs."""

from __future__ import annotations

import numba
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from carillon.arrays import Array
from carillon.errors import LocalConvergenceError
from carillon.fem.aggregation import DAMPING, Level
from carillon.fem.cell_rows import CellRows

STEPS = 2
"""Jacobi steps before and after each coarse correction."""
CYCLE = np.float32
"""Numbers of the cycle: precise enough for a preconditioner, and half the traffic of memory."""
OVERCORRECTION = CYCLE(1.6)
"""Factor of coarse corrections: between constants the coarse graph is up to twice too stiff."""
MOST_ITERATIONS = 200
"""Most iterations of conjugate gradients; some twenty are usual."""

Rough = NDArray[np.float32]


class ShiftedInverse:
    """(L + shift)^-1 by conjugate gradients with a V-cycle.

    Parameters
    ----------
    levels
        The finest is that of L, whose edges weigh 1; the matrix of the coarsest is inverted.
    shift
        Positive.
    tolerance
        Norm of the residual, relative to that of the right-hand side.
    """

    def __init__(self, levels: list[Level], shift: float, tolerance: float) -> None:
        self._tolerance = tolerance
        matrices = [(level.laplacian + shift * sp.diags(level.sizes)).tocsr() for level in levels]
        self._inverse = np.linalg.inv(matrices[-1].toarray()).astype(CYCLE)
        self._rows = CellRows(matrices[0])
        self._matrices = [matrix.astype(CYCLE) for matrix in matrices[:-1]]
        self._scales = [CYCLE(DAMPING) / matrix.diagonal() for matrix in self._matrices]
        self._sums = [level.sums.astype(CYCLE) for level in levels[1:]]
        self._restrictions = [sums.T.tocsr() for sums in self._sums]
        # Memory for all cycles: to ask for it anew takes as long as a product.
        self._left = np.zeros(len(levels[0]), dtype=CYCLE)
        self._values, self._others = (self._rows.padded(self._left) for _ in range(2))

    def solve(self, rhs: Array) -> Array:
        """Solution (m,) for a right-hand side.

        Raises LocalConvergenceError if `MOST_ITERATIONS` do not reach the tolerance.
        """
        goal = self._tolerance * np.linalg.norm(rhs)
        residual, solution, product = rhs.copy(), np.zeros(len(rhs)), np.empty(len(rhs))
        padded = self._rows.padded(np.zeros(len(rhs)))
        direction = padded[: len(rhs)]
        before = 1.0
        for _ in range(MOST_ITERATIONS):
            if np.linalg.norm(residual) <= goal:
                return solution
            improved = self._cycle(residual.astype(CYCLE)).astype(float)
            now = np.dot(residual, improved)
            _turn(direction, now / before, improved)
            self._rows.multiply(padded, product)
            step = now / np.dot(direction, product)
            _go(solution, residual, step, direction, product)
            before = now
        raise LocalConvergenceError(
            f"the Laplacian of {len(rhs):,} cells missed a residual of {self._tolerance:g} in "
            f"{MOST_ITERATIONS} iterations"
        )

    def _cycle(self, rhs: Rough) -> Rough:
        if not self._sums:
            return np.asarray(self._inverse @ rhs)
        count, rows, scale = len(rhs), self._rows, self._scales[0]
        values, others, left = self._values, self._others, self._left
        np.multiply(scale, rhs, out=values[:count])
        for _ in range(STEPS - 1):
            rows.smooth(values, rhs, scale, others)
            values, others = others, values
        rows.subtract(values, rhs, left)
        coarse = self._coarse_cycle(self._restrictions[0] @ left, 1)
        _correct(values, self._sums[0].indices, coarse)
        for _ in range(STEPS):
            rows.smooth(values, rhs, scale, others)
            values, others = others, values
        return values[:count]

    def _coarse_cycle(self, rhs: Rough, number: int) -> Rough:
        if number == len(self._sums):
            return np.asarray(self._inverse @ rhs)
        matrix, scale = self._matrices[number], self._scales[number]
        values = scale * rhs
        for _ in range(STEPS - 1):
            values += scale * (rhs - matrix @ values)
        left = self._restrictions[number] @ (rhs - matrix @ values)
        values += OVERCORRECTION * (self._sums[number] @ self._coarse_cycle(left, number + 1))
        for _ in range(STEPS):
            values += scale * (rhs - matrix @ values)
        return values


@numba.njit(cache=True, nogil=True)
def _correct(values, vertex, coarse):  # type: ignore[no-untyped-def]
    for row in range(np.uint64(len(vertex))):
        values[row] += OVERCORRECTION * coarse[np.uint64(vertex[row])]


@numba.njit(cache=True, nogil=True)
def _turn(direction, share, improved):  # type: ignore[no-untyped-def]
    for row in range(np.uint64(len(direction))):
        direction[row] = share * direction[row] + improved[row]


@numba.njit(cache=True, nogil=True)
def _go(solution, residual, step, direction, product):  # type: ignore[no-untyped-def]
    for row in range(np.uint64(len(solution))):
        solution[row] += step * direction[row]
        residual[row] -= step * product[row]
