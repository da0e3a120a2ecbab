"""Inner solvers of the error correction: the action of (K - shift M)^-1 on blocks of vectors."""

from __future__ import annotations

from copy import copy
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from carillon.errors import UserError, on_all_ranks
from carillon.processes import extras
from carillon.processes.extras import PETSC

if TYPE_CHECKING:
    from solver.assembly.system import Layout, System
    from solver.linear.iterative import IterativeInverse
    from solver.linear.rank_tree import RankTree

METHODS = ("auto", "multifrontal", "mumps", "icc-pcg", "amg-cg")
ITERATIVE = ("icc-pcg", "amg-cg")
OF_PETSC = ("mumps", *ITERATIVE)
"""Methods that need PETSc."""
MEMORY_SHARE = 0.8
"""Share of the free memory that a factorisation may take."""


class Inverse(Protocol):
    """What the error correction needs of a linear solver."""

    shift: float
    """(K - shift M) is inverted [rad^2/s^2]."""
    exact: bool
    """Whether solutions are exact to rounding."""
    negative: int
    """Eigenvalues below the shift, by Sylvester's law of inertia."""

    def solve(self, block: Array) -> Array:
        """Solutions for a row-major block of right-hand sides (local unknowns, k); collective."""

    def destroy(self) -> None:
        """Free what numpy does not."""


class Lasting:
    """An inverse to keep for similar materials: nothing but arrays, never to be freed.

    Its `diagonal` (local unknowns,) is that of its stiffness [N/m].
    """

    exact = True

    def __init__(self, factor: Inverse, diagonal: Array) -> None:
        self._factor = factor
        self.diagonal = diagonal
        self.shift = factor.shift
        self.negative = factor.negative

    def solve(self, block: Array) -> Array:
        """See `Inverse.solve`."""
        return self._factor.solve(block)

    def destroy(self) -> None:
        """Nothing but arrays to free."""


class Approximate:
    """An inverse for a similar material, good for a correction that need not be exact.

    Parameters
    ----------
    similar
        Inverse for the other material.
    system
        Stiffness and mass of the material here.
    vectors, mass_vectors
        (local, m) mass-orthonormal X that corrections need not lie in, and M X.

    Notes
    -----
    Where moduli differ smoothly, K is about D K' D with D^2 the ratio of the diagonals, and
    (K - mu M)^-1 about D^-1 (K' - mu M)^-1 D^-1 but for motions of low frequency, where the mass
    has its part.  Those are in X: the right-hand sides are made free of M X, or what D changes in
    them would be magnified next to the shift.
    """

    exact = False

    def __init__(
        self, similar: Lasting, system: System, vectors: Array, mass_vectors: Array
    ) -> None:
        self._similar, self._system = similar, system
        diagonal = system.rows.stiffness_diagonal
        self._vectors, self._mass_vectors = vectors, mass_vectors
        ratio = np.divide(
            similar.diagonal, diagonal, out=np.ones_like(diagonal), where=diagonal > 0
        )
        self._scale = np.sqrt(ratio)[:, None]
        self.shift = similar.shift
        self.negative = similar.negative

    def solve(self, block: Array) -> Array:
        """Solutions of the similar system, scaled."""
        block = self._scale * block
        block -= self._mass_vectors @ self._system.inner(self._vectors, block)
        solution = self._similar.solve(block)
        solution *= self._scale
        return solution

    def destroy(self) -> None:
        """Leave it to its owner."""


class LinearSolver:
    """Makes inverses of one mesh for any material and shift.

    What depends on the mesh alone is computed once: when `method` or an inverse is first asked for,
    by all ranks. Raises UserError for an unknown method.

    Parameters
    ----------
    method
        `multifrontal`: sparse factorisation by blocks.  `mumps`: the same by MUMPS.  `icc-pcg`:
        conjugate gradients with incomplete Cholesky, the paper's.  `amg-cg`: conjugate gradients
        with algebraic multigrid, for models too large to factorise.  `auto`: `multifrontal` if the
        memory of all machines holds it, or PETSc is not installed, or else `amg-cg`.
    """

    def __init__(self, method: str, layout: Layout) -> None:
        self._layout = layout
        require_method(method)
        self._asked = method

    @cached_property
    def method(self) -> str:
        """The method, which `auto` stands for; collective when first asked for."""
        if self._asked == "auto":
            # Without PETSc a factorisation is begun, which says how much memory it lacks.
            if self.tree.fits(MEMORY_SHARE) or not extras.is_installed(PETSC):
                return "multifrontal"
            return "amg-cg"
        if self._asked == "multifrontal":
            self.tree  # noqa: B018
        return self._asked

    def by(self, method: str) -> LinearSolver:
        """Solver by another method, which shares what was computed of the mesh."""
        other = copy(self)
        other.method = method
        return other

    @cached_property
    def tree(self) -> RankTree:
        """Elimination by all ranks; made when first asked for, collective."""
        from solver.linear.rank_tree import RankTree

        return RankTree(self._layout)

    def count_below(self, system: System, value: float) -> int:
        """Eigenvalues of K - value M below zero, by inertia; collective."""
        return self.tree.count_below(system, value)

    @property
    def indefinite(self) -> bool:
        """Whether the shift may lie among the eigenvalues."""
        return self.method not in ITERATIVE

    def iterative(self, system: System, shift: float) -> IterativeInverse:
        """Inverse of K - shift M, for a negative shift, by an iterative method."""
        from solver.linear.iterative import IterativeInverse

        return IterativeInverse(system, shift, self.method, threads=system.rows.threads)

    def inverse(self, system: System, shift: float) -> Inverse:
        """Inverse of K - shift M; the shift is negative for an iterative method."""
        if self.method == "multifrontal":
            inverse = self.tree.inverse(system, shift)
            return Lasting(inverse, system.rows.stiffness_diagonal)
        if self.method == "mumps":
            from solver.linear.factorisation import MumpsInverse

            return MumpsInverse(system, shift)
        return self.iterative(system, shift)


@on_all_ranks()
def require_method(method: str, what: str = "") -> None:
    """Raise UserError for an unknown method, or one that `what` needs and is not installed."""
    if method not in METHODS:
        raise UserError(f"linear solver {method!r}, expected one of {', '.join(METHODS)}")
    if method in OF_PETSC:
        what = what or f"--linear-solver {method}"
        extras.require(PETSC, what, "leave it out: auto takes what is there")
