"""Conjugate gradients on blocks of right-hand sides: each its own, all advanced together.

Section 7.2.1 of the paper solves (K + sigma M) Z = R by conjugate gradients preconditioned by an
incomplete Cholesky factor, `icc-pcg`.  `amg-cg` replaces the factor by smoothed aggregation, for
models that are too large to factor: its iterations hardly grow with the mesh.
"""

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from carillon.errors import ConvergenceError
from carillon.fem.element import rigid_motions
from carillon.fem.model import RIGID_MODES
from carillon.processes.petsc import PETSc
from carillon.processes.threads import in_parallel, split
from solver.assembly.system import System, distributed_matrix
from solver.linear.factorisation import IncompleteCholesky
from solver.linear.multigrid import Multigrid

METHODS = ("icc-pcg", "amg-cg")
TOLERANCE = 1e-1
"""Relative residual that the error correction needs of a solve.  Solutions only enrich the basis of
a Rayleigh-Ritz method, and from here on its eigenvalues hardly tell them from exact ones: on the
bunny at resolution 32, 1e-1 takes as many correction steps as a factorisation, 3e-1 takes more."""
MAX_ITERATIONS = 2000
"""Largest number of iterations for a right-hand side."""
STALL_ITERATIONS = 300
"""Number of iterations within which the smallest residual of a column must fall."""
STALL_REDUCTION = 0.9
"""Factor by which the smallest residual of a column must fall."""
TINY = np.finfo(float).tiny
COLUMNS = 64
"""Number of right-hand sides that are advanced together."""
ROUNDS = 3
"""Number of restarts from the true residual, from which rounding parts the recursive one."""


class IterativeInverse:
    """(K - shift M)^-1 by preconditioned conjugate gradients, for shift < 0; see `Inverse`.

    Parameters
    ----------
    tolerance
        Largest accepted |b - (K - shift M) x| / |b| of a column, Euclidean norms.

    Attributes
    ----------
    iterations
        Iterations so far, summed over the right-hand sides.
    """

    exact = False
    negative = 0

    def __init__(
        self,
        system: System,
        shift: float,
        method: str = "amg-cg",
        tolerance: float = TOLERANCE,
        max_iterations: int = MAX_ITERATIONS,
        columns: int = COLUMNS,
        threads: int = 1,
    ) -> None:
        if shift >= 0.0:
            raise ValueError("a free body has a singular stiffness; the shift must be negative")
        if method not in METHODS:
            raise ValueError(f"'{method}' is none of the linear solvers {', '.join(METHODS)}")
        self.shift = shift
        self.iterations = 0
        self._system = system
        self._method = method
        self._tolerance = tolerance
        self._max_iterations = max_iterations
        self._columns = columns
        self._rigid = np.ascontiguousarray(system.rigid)
        self._mass_rigid = system.times_mass(self._rigid)
        self._threads = threads
        self._preconditioner = self._prepare()

    def _prepare(self) -> IncompleteCholesky | Multigrid:
        system = self._system
        matrix = distributed_matrix(system.rows.shifted_csr(self.shift, system.n_dofs), system.comm)
        matrix.setOption(PETSc.Mat.Option.SPD, True)
        try:
            if self._method == "icc-pcg":
                return IncompleteCholesky(matrix)
            # The finest level leaves out the shift, which only rigid motions need on coarse ones.
            finest = system.rows.stiffness_products
            near = self._rigid
            if system.n_rigid < RIGID_MODES:
                # A held solid's coarse levels still have to move and turn.
                near = np.ascontiguousarray(rigid_motions(system.coordinates, np.zeros(3)))
            return Multigrid(matrix, near, system.comm, finest, self._threads)
        finally:
            matrix.destroy()

    def precondition(self, block: Array) -> Array:
        """One application of the preconditioner to a block (local, k); collective."""
        return self._preconditioner.apply(block)

    def solve(self, block: Array) -> Array:
        """Solution (local, k) for a row-major block of right-hand sides (local, k); collective.

        Raises ConvergenceError on every rank, if a column misses the tolerance.
        """
        solution = np.empty(block.shape)
        for first in range(0, block.shape[1], self._columns):
            chosen = slice(first, first + self._columns)
            solution[:, chosen] = self._solve_columns(np.ascontiguousarray(block[:, chosen]))
        return solution

    def _solve_columns(self, rhs: Array) -> Array:
        """Rigid part in closed form, K R = 0, and the rest by conjugate gradients."""
        share = self._system.inner(self._rigid, rhs)
        solution = self._rigid @ (share / -self.shift)
        target = self._tolerance * self._norms(rhs)
        before = self.iterations
        for _ in range(ROUNDS):
            residual = rhs - self._apply(solution)
            missed = self._norms(residual) > target
            if not missed.any():
                return solution
            solution[:, missed] += self._iterate(residual[:, missed], target[missed])
        norms = self._norms(rhs - self._apply(solution))
        if (norms > target).any():
            raise self._failure(norms, target, (self.iterations - before) // len(target))
        return solution

    def _iterate(self, residual: Array, target: Array) -> Array:
        """Conjugate gradients from zero (Hestenes & Stiefel 1952) until |residual| <= target."""
        products = self._system.column_products
        residual = residual.copy()
        finished = np.empty_like(residual)
        solution = np.zeros_like(residual)
        progress = _Progress(self._norms(residual))
        active = np.arange(residual.shape[1])
        direction = np.zeros_like(residual)
        energy = np.ones(len(active))
        for step in range(1, self._max_iterations + 1):
            energy = self._turn(direction, residual, energy)
            image = self._apply(direction)
            length = energy / products(direction, image)
            self._by_rows(_advance, length, solution, residual, direction, image)
            self.iterations += len(active)
            norms = self._norms(residual)
            # Written so that a length that is not a number counts as a breakdown, too.
            if not (length > 0.0).all() or progress.stalled(step, active, norms):
                break
            left = norms > target[active]
            if not left.all():
                finished[:, active[~left]] = solution[:, ~left]
                active = active[left]
                if not len(active):
                    return finished
                solution, residual, direction = (
                    np.ascontiguousarray(each[:, left]) for each in (solution, residual, direction)
                )
                energy = energy[left]
        raise self._failure(norms, target[active], step)

    def _apply(self, block: Array) -> Array:
        image = self._system.times_mass(block)
        image *= -self.shift
        image += self._system.times_stiffness(block)
        return image

    def _turn(self, direction: Array, residual: Array, before: Array) -> Array:
        """Make `direction` conjugate again, in place; returns the residual's energy.

        The preconditioned residual loses its rigid part, which the residual does not have: the
        search then never meets the smallest eigenvalues, those of the rigid motions.
        """
        preconditioned = self._preconditioner.apply(residual)
        energy = self._system.column_products(residual, preconditioned)
        share = self._system.inner(self._mass_rigid, preconditioned)
        ratio = energy / before
        self._by_rows(_conjugate, (ratio, share), direction, preconditioned, self._rigid)
        return energy

    def _by_rows(self, kernel: Callable[..., None], weights: Any, *blocks: Array) -> None:
        """Run a kernel on blocks of the same rows, which the threads share."""
        rows = len(blocks[0])

        def work(start: int, stop: int) -> None:
            kernel(weights, *(block[start:stop] for block in blocks))

        in_parallel(work, split(rows, self._threads, max(rows, 1)), self._threads)

    def _norms(self, block: Array) -> Array:
        return np.sqrt(self._system.column_products(block, block))

    def _failure(self, norms: Array, target: Array, steps: int) -> ConvergenceError:
        worst = self._tolerance * float(np.max(norms / np.maximum(target, TINY)))
        others = [name for name in METHODS if name != self._method]
        return ConvergenceError(
            f"{self._method} stopped at a relative residual of {worst:.1e} after {steps:,} "
            f"iterations, {self._tolerance:.1e} was asked for ({(~(norms <= target)).sum()} of "
            f"{len(norms)} right-hand sides left); take {' or '.join(others)} or a sparse "
            "factorisation as linear solver"
        )

    def destroy(self) -> None:
        """Free the preconditioner."""
        self._preconditioner.destroy()


class _Progress:
    def __init__(self, norms: Array) -> None:
        self._best = norms.copy()
        self._since = np.zeros(len(norms), dtype=np.int64)

    def stalled(self, step: int, active: NDArray[np.integer], norms: Array) -> bool:
        """Whether a column has not improved for `STALL_ITERATIONS`."""
        better = norms < STALL_REDUCTION * self._best[active]
        self._best[active[better]] = norms[better]
        self._since[active[better]] = step
        return bool((step - self._since[active] >= STALL_ITERATIONS).any())


@numba.njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
def _advance(length, solution, residual, direction, image):  # type: ignore[no-untyped-def]
    """Step of `length` along `direction`, in one pass over the memory."""
    for row in range(solution.shape[0]):
        x, r, p, q = solution[row], residual[row], direction[row], image[row]
        for k in range(len(length)):
            x[k] += length[k] * p[k]
            r[k] -= length[k] * q[k]


@numba.njit(cache=True, nogil=True, fastmath={"contract"}, error_model="numpy")
def _conjugate(weights, direction, ahead, rigid):  # type: ignore[no-untyped-def]
    """direction = ratio * direction + ahead - rigid share, in one pass over the memory."""
    ratio, share = weights
    for row in range(direction.shape[0]):
        p, z = direction[row], ahead[row]
        for k in range(len(ratio)):
            p[k] = ratio[k] * p[k] + z[k]
        for i in range(rigid.shape[1]):
            weight = rigid[row, i]
            motion = share[i]
            for k in range(len(ratio)):
                p[k] -= weight * motion[k]
