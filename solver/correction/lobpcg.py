"""Locally optimal block preconditioned conjugate gradients (Knyazev 2001), without a factorisation.

Every step takes the lowest Ritz pairs of the span of the vectors X, their preconditioned residuals
W, and the direction P that the last step took.  A cycle of multigrid is the preconditioner.
"""

from collections.abc import Callable

import numpy as np

from carillon.arrays import Array, Index
from carillon.errors import ConvergenceError
from carillon.processes.threads import in_parallel, split
from solver.assembly.system import System
from solver.correction.result import Correction
from solver.distribution.collective import bcast_from_root
from solver.subspace.orthonormal import orthonormal
from solver.subspace.rayleigh_ritz import rayleigh_ritz, reduced_eigenpairs

ROWS_AT_ONCE = 2048
"""Number of rows of the basis that are multiplied together and written back."""
STAGNATION, PROGRESS = 12, 0.7
"""Number of steps within which the worst error must fall, and the share of it that may be left."""
SAFETY = 2.0
"""Largest ratio of an eigenvalue's error to the estimate of it by one cycle of the
preconditioner."""
LEFT = 0.5
"""Error of an eigenvalue that may be left after a step, as a share of the last reduction."""


def lobpcg(
    system: System,
    precondition: Callable[[Array], Array],
    start: Array,
    requested: int,
    tolerance: float,
    max_steps: int,
    report: Callable[[int, float], None] | None = None,
) -> Correction:
    """Lowest elastic modes from a block of approximate ones.

    Raises ConvergenceError if the start spans too few modes, or the error stops falling.

    Parameters
    ----------
    precondition
        Symmetric approximation of K^-1 on blocks (local, k).
    start
        (local, m) vectors, more than requested: the last ones converge slowly.
    tolerance
        Relative eigenvalue error to stop at; zero makes all steps.

    Notes
    -----
    A Ritz value theta with the residual r is r^T (K - theta M)^-1 r too high, to second order.
    Where r has no part in the modes below theta_m, the last of the block, that is at most
    theta_m / (theta_m - theta) times r^T K^-1 r, for which the preconditioner stands; should it be
    too small, what the last step took off the value tells.
    """
    values, vectors = rayleigh_ritz(system, start)
    if len(values) < requested:
        raise ConvergenceError(
            f"the start block spans {len(values)} elastic modes, {requested} are wanted; keep more"
        )
    basis = _Trial(system, values, vectors)
    errors, before = np.full(len(values), np.inf), np.full(len(values), np.inf)
    active = np.arange(len(values))
    history: list[float] = []
    solves = 0
    for step in range(max_steps + 1):
        residual = basis.residual(active)
        image = np.ascontiguousarray(precondition(residual))
        solves += len(active)
        energy = system.column_products(residual, image)
        last = basis.values[-1]
        distance = np.maximum(last - basis.values[active], np.finfo(float).eps * last)
        errors[active] = SAFETY * energy * last / (distance * basis.values[active])
        fallen = before[active] / basis.values[active] - 1.0
        errors[active] = np.maximum(errors[active], LEFT * fallen)
        before = basis.values
        worst = float(errors[:requested].max())
        history.append(worst)
        if report is not None:
            report(step, worst)
        if worst <= tolerance or step == max_steps:
            break
        recent = history[-STAGNATION - 1 :]
        if tolerance > 0.0 and len(recent) > STAGNATION and recent[-1] > PROGRESS * recent[0]:
            raise ConvergenceError(
                f"conjugate gradients stagnate at an eigenvalue error of {worst:.1e} after {step} "
                f"steps, {tolerance:.1e} was asked for; use another linear solver "
                "(--linear-solver) or a looser tolerance"
            )
        moving = errors[active] > 0.1 * tolerance
        basis.step(image[:, moving], active[moving])
        active = np.flatnonzero(errors > 0.1 * tolerance)
    vectors = basis.vectors
    return Correction(
        basis.values[:requested],
        np.ascontiguousarray(vectors[:, :requested]),
        errors[:requested],
        np.ascontiguousarray(vectors[:, requested:]),
        step,
        solves,
        step + 1,
        history,
    )


class _Trial:
    """X, P and W side by side, and their products with K and M."""

    def __init__(self, system: System, values: Array, vectors: Array) -> None:
        self._system = system
        self._mass_rigid = system.times_mass(system.rigid)
        self._width = self._used = len(values)
        self.values = values
        shape = (len(vectors), 3 * self._width)
        self._block, self._stiff, self._mass = (np.empty(shape) for _ in range(3))
        self._set(0, vectors)

    @property
    def vectors(self) -> Array:
        """X (local, m)."""
        return np.ascontiguousarray(self._block[:, : self._width])

    def residual(self, numbers: Index) -> Array:
        """K x - theta M x of some vectors."""
        residual = self._mass[:, numbers] * -self.values[numbers]
        residual += self._stiff[:, numbers]
        return residual

    def step(self, image: Array, numbers: Index) -> None:
        """Replace X by the lowest Ritz vectors of the span of X, P and `image` (local, w).

        `numbers` (w,) are the vectors whose directions are kept for the next step.
        """
        system, width = self._system, self._width
        image = self._complement(image)
        self._set(self._used, image)
        used = self._used + image.shape[1]
        block = self._block[:, :used]
        stiff = np.diag(np.concatenate([self.values, np.zeros(used - width)]))
        gram = np.eye(used)
        for products, projected in ((self._stiff, stiff), (self._mass, gram)):
            projected[:, width:] = system.inner(block, products[:, width:used])
            projected[width:] = projected[:, width:].T
        # Solved once: two processors may round apart, and an eigenvector's sign hangs on rounding.
        values, weights = bcast_from_root(system.comm, lambda: reduced_eigenpairs(stiff, gram))
        of_directions = weights[:, numbers].copy()
        of_directions[:width] = 0.0
        weights = np.concatenate([weights[:, :width], of_directions], axis=1)
        for array in (self._block, self._stiff, self._mass):
            self._rotate(array, weights)
        if len(values) < width or not np.isfinite(values[:width]).all():
            raise ConvergenceError(
                f"conjugate gradients lost some of their {width} vectors, which became linearly "
                "dependent; ask for fewer --modes or use --method auto"
            )
        self.values = values[:width]
        self._used = weights.shape[1]

    def _complement(self, image: Array) -> Array:
        """An orthonormal basis of what is in `image` beside the rigid motions and X."""
        system = self._system
        image -= system.rigid @ system.inner(self._mass_rigid, image)
        vectors, mass = self._block[:, : self._width], self._mass[:, : self._width]
        image -= vectors @ system.inner(mass, image)
        gram = system.inner(image, system.times_mass(image))
        basis, _ = bcast_from_root(system.comm, lambda: orthonormal(gram))
        return np.asarray(image @ basis)

    def _set(self, first: int, vectors: Array) -> None:
        columns = slice(first, first + vectors.shape[1])
        self._block[:, columns] = vectors
        self._stiff[:, columns] = self._system.times_stiffness(vectors)
        self._mass[:, columns] = self._system.times_mass(vectors)

    def _rotate(self, array: Array, weights: Array) -> None:
        """The first columns of `array` become its columns times the weights, in place."""
        used, columns = weights.shape
        threads, rows = self._system.rows.threads, len(array)

        def part(start: int, stop: int) -> None:
            for first in range(start, stop, ROWS_AT_ONCE):
                here = slice(first, min(first + ROWS_AT_ONCE, stop))
                array[here, :columns] = array[here, :used] @ weights

        in_parallel(part, split(rows, threads, max(rows, 1)), threads)
