"""ARPACK as SciPy has it, in shift-and-invert mode with Carillon's own factorisation: on one rank.

Known eigenvectors X are deflated.  ARPACK sees P (K + s M)^-1 P^T with P = I - X X^T M, which is as
symmetric in the inner product of M, and whose eigenvalue 0 belongs to what X spans.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg as la

from carillon.arrays import Array
from solver.assembly.system import System
from solver.linear import LinearSolver

if TYPE_CHECKING:
    from scipy.sparse.linalg import LinearOperator

MAX_RESTARTS = 500
FEWEST_MORE = 24
"""Least number of Lanczos vectors beyond the requested pairs."""
SUBSPACE = 2
"""Lanczos vectors for each requested pair. With fewer a restart gains little."""
SPARE = 2
"""Least number of dimensions that ARPACK leaves unused."""


def smallest_eigenpairs(
    system: System, known: Array, count: int, shift: float, start: Array, tolerance: float
) -> tuple[Array, Array, int]:
    """See `solver.reference.eigensolver.smallest_eigenpairs`; iterations are products by ARPACK.

    Where nearly all eigenpairs are asked for, LAPACK finds all of them.
    """
    left = system.n_dofs - known.shape[1]
    if count > left - SPARE:
        return _all_eigenpairs(system, known)
    from scipy.sparse.linalg import ArpackError, ArpackNoConvergence, eigsh

    operators = _Operators(system, known, shift)
    subspace = min(max(SUBSPACE * count, count + FEWEST_MORE), left)
    try:
        values, vectors = eigsh(
            operators.stiffness,
            count,
            operators.mass,
            sigma=-shift,
            OPinv=operators.inverse,
            v0=operators.project(start[:, None])[:, 0],
            ncv=subspace,
            maxiter=MAX_RESTARTS,
            tol=tolerance,
        )
    except ArpackNoConvergence as error:
        values, vectors = error.eigenvalues, error.eigenvectors
    except ArpackError:  # nothing is left that the start has a share in
        values, vectors = np.empty(0), np.empty((system.n_dofs, 0))
    order = np.argsort(values, kind="stable")
    return values[order], np.ascontiguousarray(vectors[:, order]), operators.products


class _Operators:
    """K, M and the deflated inverse as ARPACK takes them, with the number of `products`."""

    def __init__(self, system: System, known: Array, shift: float) -> None:
        self._system = system
        self._known, self._mass_known = known, system.times_mass(known)
        self._inverse = LinearSolver("multifrontal", system.layout).inverse(system, -shift)
        self.products = 0

    def project(self, block: Array) -> Array:
        """P times a block: what is not in the span of the known vectors."""
        return np.asarray(block - self._known @ (self._mass_known.T @ block))

    def _solve(self, vector: Array) -> Array:
        self.products += 1
        right = vector.reshape(-1, 1)
        right = right - self._mass_known @ (self._known.T @ right)
        return self.project(self._inverse.solve(np.ascontiguousarray(right)))[:, 0]

    def _times_stiffness(self, vector: Array) -> Array:
        return self._system.times_stiffness(vector.reshape(-1, 1))[:, 0]

    def _times_mass(self, vector: Array) -> Array:
        return self._system.times_mass(np.ascontiguousarray(vector.reshape(-1, 1)))[:, 0]

    @property
    def stiffness(self) -> LinearOperator:
        """K."""
        return self._operator(self._times_stiffness)

    @property
    def mass(self) -> LinearOperator:
        """M."""
        return self._operator(self._times_mass)

    @property
    def inverse(self) -> LinearOperator:
        """P (K + s M)^-1 P^T."""
        return self._operator(self._solve)

    def _operator(self, product: Callable[[Array], Array]) -> LinearOperator:
        from scipy.sparse.linalg import LinearOperator

        size = self._system.n_dofs
        return LinearOperator((size, size), matvec=product, dtype=float)


def _all_eigenpairs(system: System, known: Array) -> tuple[Array, Array, int]:
    """All eigenpairs outside the span of the known vectors, by LAPACK."""
    complement = np.eye(system.n_dofs)
    if known.shape[1]:
        complement = np.ascontiguousarray(la.null_space(system.times_mass(known).T))
    stiff = system.project_stiffness(complement, complement)
    mass = system.project_mass(complement, complement)
    values, weights = la.eigh(stiff, mass)
    return values, complement @ weights, 1
