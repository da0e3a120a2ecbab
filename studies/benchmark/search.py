"""What a further rival is asked for, and how long it may take."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as sla

from carillon.arrays import Array
from carillon.errors import ConvergenceError
from solver.assembly.system import System
from solver.linear import LinearSolver
from solver.subspace.rayleigh_ritz import safe_shift

Pairs = tuple[Array, Array]
"""Eigenvalues (k,) [rad^2/s^2] and vectors (n, k), orthonormal with respect to `RivalSearch.M`."""


@dataclass(frozen=True)
class RivalSearch:
    """The lowest elastic eigenpairs of an assembled system on one rank.

    The unknowns are scaled so that the mass has a unit diagonal: the norms by which general solvers
    stop mean the same for every unknown then.
    """

    system: System
    """On one rank."""
    linear: LinearSolver
    """Makes inverses on its mesh."""
    count: int
    """Elastic pairs wanted."""
    interval: tuple[float, float]
    """An interval (low, high) [rad^2/s^2] that holds them and no rigid motions."""
    tolerance: float
    """Of |K x - lambda M x| / lambda in the 2-norm, where x has unit mass."""
    seed: int
    """Of what the search starts from."""
    seconds: float
    """Wall time from when this is made after which a rival is given up."""
    begin: float = field(default_factory=time.perf_counter)

    @property
    def late(self) -> bool:
        """Whether the time is up."""
        return time.perf_counter() > self.begin + self.seconds

    def check_time(self) -> None:
        """Raise ConvergenceError if the time is up."""
        if self.late:
            raise ConvergenceError(f"did not converge in {self.seconds:g} s")

    @cached_property
    def scale(self) -> Array:
        """(n,) factors from scaled unknowns to displacements."""
        mass = self.system.rows.mass_csr(self.system.n_dofs)
        return np.asarray(1.0 / np.sqrt(mass.diagonal()))

    @cached_property
    def K(self) -> sp.csr_matrix:  # noqa: N802
        """Scaled stiffness [rad^2/s^2]."""
        return self._scaled(self.system.rows.stiffness_csr(self.system.n_dofs))

    @cached_property
    def M(self) -> sp.csr_matrix:  # noqa: N802
        """Scaled mass [1]."""
        return self._scaled(self.system.rows.mass_csr(self.system.n_dofs))

    @cached_property
    def rigid(self) -> Array:
        """(n, 6) rigid motions, orthonormal with respect to `M`."""
        return np.asarray(self.system.rigid / self.scale[:, None])

    @cached_property
    def shift(self) -> float:
        """Sigma [rad^2/s^2] of the definite K + sigma M."""
        return safe_shift(self.system)

    @cached_property
    def shifted(self) -> sp.csr_matrix:
        """K + sigma M."""
        return self.K + self.shift * self.M

    @property
    def stiffness(self) -> sla.LinearOperator:
        """Products with `K`, refused when the time is up."""
        return self.operator(lambda block: self.K @ block)

    def operator(self, product: Callable[[Array], Array]) -> sla.LinearOperator:
        """A product with a vector or block (n, k) as SciPy's operator, within the time limit."""

        def checked(block: Array) -> Array:
            self.check_time()
            return np.asarray(product(block))

        return sla.LinearOperator(self.K.shape, matvec=checked, matmat=checked, dtype=float)

    def start(self, columns: int) -> Array:
        """Random vectors (n, columns) to start from."""
        return np.random.default_rng(self.seed).standard_normal((self.K.shape[0], columns))

    def _scaled(self, matrix: sp.csr_matrix) -> sp.csr_matrix:
        scale = sp.diags(self.scale)
        return (scale @ matrix @ scale).tocsr()


def ascending(values: Any, vectors: Array) -> Pairs:
    """Eigenpairs in the order of their values."""
    order = np.argsort(values, kind="stable")
    return np.asarray(values)[order], vectors[:, order]
