"""Ground truth: shift-and-invert Krylov-Schur or ARPACK, with proof of completeness."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from carillon.arrays import Array
from carillon.errors import ConvergenceError
from carillon.processes import extras
from carillon.processes.extras import PETSC
from solver.assembly.system import System
from solver.linear import LinearSolver
from solver.reference.eigensolver import installed_method, smallest_eigenpairs
from solver.subspace.rayleigh_ritz import is_orthonormal, rayleigh_ritz, rigid_pairs, safe_shift
from solver.subspace.start import start_vector

RESIDUAL_TOLERANCE = 1e-10
"""Default of the relative residual of ground truth."""
SPARE_MODES = 8
"""Number of modes computed beyond those requested, so that the inertia count finds a gap."""
FRUITLESS_SEARCHES = 3
"""Number of successive searches without a result after which missing eigenvalues are given up."""
ABOVE_ALL = 1e-6
"""Relative distance above the last eigenvalue at which all are counted."""


@dataclass(frozen=True)
class Truth:
    """Eigenpairs from a general solver."""

    values: Array
    vectors: Array
    """(k,) ascending and (local, k), rigid modes included, k = `modes` and a few to spare."""
    modes: int
    """Number of modes asked for."""
    iterations: int
    """Outer iterations of the eigensolver."""
    searches: int = 0
    """Searches in the complement of what was found before that went on where modes were missing."""
    added: int = 0
    """Modes that these found."""

    def lowest(self) -> tuple[Array, Array]:
        """The eigenpairs asked for, vectors row-major."""
        vectors = np.ascontiguousarray(self.vectors[:, : self.modes])
        return self.values[: self.modes], vectors


@dataclass(frozen=True)
class Inertia:
    """Number of eigenvalues below `value` [rad^2/s^2]: counted by a factorisation, and computed."""

    value: float
    counted: int
    computed: int


def solve_truth(
    system: System,
    modes: int,
    method: str = "slepc",
    tolerance: float = RESIDUAL_TOLERANCE,
    spare: int = SPARE_MODES,
    seed: int = 0,
) -> Truth:
    """Compute the `modes` lowest eigenpairs of the assembled system, rigid modes included.

    The rigid motions are known and deflated.  Of other multiple eigenvalues copies may be
    missed; see `complete`. Raises ConvergenceError if too few pairs converge.

    Parameters
    ----------
    method
        `slepc` (Krylov-Schur) or `arpack`, both in shift-and-invert mode; see
        `solver.reference.eigensolver`.
    spare
        Modes beyond, among which `count_beyond` looks for a gap.
    """
    truth = Truth(*rigid_pairs(system), modes, 0)
    requested = min(modes + spare, system.n_dofs) - system.n_rigid
    truth = _with_lowest(system, truth, requested, start_vector(system, seed), tolerance, method)
    few = modes - len(truth.values)
    if few > 0:
        truth = _search_on(system, truth, np.inf, few, tolerance, seed)
    if len(truth.values) < modes:
        raise ConvergenceError(
            f"{method} converged {len(truth.values)} of {modes} modes to {tolerance:.0e} in "
            f"{truth.iterations} iterations"
        )
    return truth


def can_count() -> bool:
    """Whether eigenvalues can be counted by inertia, for which PETSc needs MUMPS.

    Where PETSc is not installed Carillon's own factorisation counts.
    """
    if not extras.is_installed(PETSC):
        return True
    from carillon.processes.petsc import PETSc

    return bool(PETSc.Sys.hasExternalPackage("mumps"))


def count_beyond(
    system: System, truth: Truth, count: Callable[[System, float], int] | None = None
) -> Inertia:
    """Count, by the inertia of K - mu M, the eigenvalues below a mu beyond the last wanted one.

    The shift mu lies in the widest gap among the spare modes.  MUMPS counts, unless `count` does,
    or PETSc is not installed.
    """
    value, computed = _gap(truth.values, truth.modes, system.n_dofs)
    return Inertia(value, (count or count_below)(system, value), computed)


def count_below(system: System, value: float) -> int:
    """Eigenvalues of K - value M below zero, by inertia; see `can_count`; collective."""
    if not extras.is_installed(PETSC):
        return LinearSolver("multifrontal", system.layout).count_below(system, value)
    from solver.linear.factorisation import count_negative

    return count_negative(system.K, system.M, value)


def complete(
    system: System,
    truth: Truth,
    inertia: Inertia | None,
    tolerance: float = RESIDUAL_TOLERANCE,
    seed: int = 0,
) -> tuple[Truth, Inertia | None]:
    """Find the eigenpairs that `truth` lacks, by a search in the complement of those it has.

    Every search starts from another vector and deflates what is there, so that of each multiple
    eigenvalue it finds one copy at least.  Without a count the first search that finds nothing
    below the last wanted eigenvalue ends it: evidence, but no proof. The `inertia` is what was
    counted; None where that cannot be done. Returns eigenpairs, of which the first `modes` are
    complete, and the count with what is computed now. Raises ConvergenceError if the count
    contradicts the computed number in the end.
    """
    if inertia is None:
        last = float(truth.values[truth.modes - 1])
        return _search_on(system, truth, last, None, tolerance, seed), None
    missing = inertia.counted - inertia.computed
    before = truth.added
    truth = _search_on(system, truth, inertia.value, missing, tolerance, seed)
    inertia = replace(inertia, computed=inertia.computed + truth.added - before)
    if inertia.computed != inertia.counted:
        reason = (
            f"eigenvalues were missed, and {truth.searches} further searches did not find them"
            if inertia.computed < inertia.counted
            else "some of them are none, or lie so close to that value that they cannot be counted"
        )
        raise ConvergenceError(
            f"the solver found {inertia.computed} eigenvalues below {inertia.value:.6g} "
            f"rad^2/s^2, the inertia of K - mu M counts {inertia.counted}: {reason}"
        )
    return truth, inertia


def _search_on(
    system: System, truth: Truth, below: float, missing: int | None, tolerance: float, seed: int
) -> Truth:
    """`truth` with up to `missing` more eigenpairs below a value; with all there are, if None."""
    end = 1 if missing is None else FRUITLESS_SEARCHES
    added = latest = fruitless = 0
    while (missing is None or added < missing) and fruitless < end:
        count = max(1, 2 * latest) if missing is None else missing - added
        start = start_vector(system, seed, truth.searches + 1)
        before = len(truth.values)
        truth = _with_lowest(system, truth, count, start, tolerance, below=below)
        latest = len(truth.values) - before
        truth = replace(truth, searches=truth.searches + 1, added=truth.added + latest)
        added += latest
        fruitless = 0 if latest else fruitless + 1
    return truth


def _with_lowest(
    system: System,
    truth: Truth,
    count: int,
    start: Array,
    tolerance: float,
    method: str | None = None,
    below: float = np.inf,
) -> Truth:
    """`truth` with the lowest eigenpairs below a value that one search finds in its complement.

    Without a method what is installed does it, as it is set up here, whatever PETSc's options say.
    """
    values, vectors, iterations = smallest_eigenpairs(
        system,
        truth.vectors,
        count,
        safe_shift(system),
        start,
        tolerance,
        method or installed_method(),
        configurable=method is not None,
    )
    if not is_orthonormal(system, vectors, system.times_mass(vectors)):
        values, vectors = rayleigh_ritz(system, vectors)
    inside = values < below
    values = np.concatenate([truth.values, values[inside]])
    vectors = np.concatenate([truth.vectors, vectors[:, inside]], axis=1)
    order = np.argsort(values, kind="stable")
    return replace(
        truth,
        values=values[order],
        vectors=vectors[:, order],
        iterations=truth.iterations + iterations,
    )


def _gap(values: Array, modes: int, n_dofs: int) -> tuple[float, int]:
    """Middle of the widest relative gap after the last wanted value, and the count below it."""
    if len(values) <= modes or len(values) == n_dofs:
        return float(values[-1] * (1.0 + ABOVE_ALL)), len(values)
    above = values[modes:]
    # Where a solid hangs on hinges, more values than those of its rigid motions are zero.
    gaps = np.divide(np.diff(values[modes - 1 :]), above, np.zeros(len(above)), where=above > 0.0)
    widest = int(np.argmax(gaps)) + modes
    return float(0.5 * (values[widest - 1] + values[widest])), widest
