"""Error correction by accelerated subspace iteration (section 7.2.1, Eq. 16-21)."""

from collections.abc import Callable

import numpy as np

from carillon.arrays import Array
from carillon.errors import ConvergenceError
from carillon.processes.memory import give_back_freed_memory
from solver.assembly.system import System
from solver.correction.criteria import EIGENVALUE_TOLERANCE, default_guard
from solver.correction.enrichment import Ritz
from solver.correction.lobpcg import lobpcg
from solver.correction.random_start import LanczosStart
from solver.correction.result import Correction
from solver.correction.subspace_iteration import SubspaceIteration
from solver.linear import Lasting, LinearSolver
from solver.subspace.rayleigh_ritz import rayleigh_ritz, safe_shift
from solver.subspace.start import every_unknown, start_block

BLOCKS_OF_A_STEP = 3
"""Number of blocks that a step of conjugate gradients spans: modes, residuals and directions."""


def correct(
    system: System,
    start: Array | Callable[[], Array] | None,
    requested: int,
    linear: LinearSolver,
    values: Array | None = None,
    tolerance: float = EIGENVALUE_TOLERANCE,
    max_steps: int = 30,
    acceleration: str = "lanczos",
    report: Callable[[int, float], None] | None = None,
    observe: Callable[[int, Array], None] | None = None,
    similar: Lasting | None = None,
    begun: LanczosStart | None = None,
    keep: bool = False,
) -> Correction:
    """Improve the `requested` lowest elastic modes from the block `start` until they are accurate.

    A step solves (K - mu M) Z = K X - X Theta M for every mode that is not yet accurate.  With
    `krylov` the Rayleigh-Ritz method then runs in the span of X and Z together, which holds what
    the subspace iteration of Eq. (16)-(21) would reach with the best weights; with `relaxation` in
    the span of X - w Z with the over-relaxation w of Bathe & Ramaswamy (1980), as in the paper.
    Accurate modes are locked.  With `lanczos` the first step is a whole block Lanczos iteration
    from all modes together, see `solver.correction.lanczos`; what it leaves undone, and any start
    that is nearly good enough, is for `krylov`, as everything is with `icc-pcg`.  With `amg-cg`
    every step takes one cycle of multigrid, see `solver.correction.lobpcg`. Raises ConvergenceError
    if `tolerance` is positive and not reached, unless that is to be kept; or if the vectors
    collapse to too few.

    Parameters
    ----------
    start
        (local, q) approximate modes, q > requested for a margin, or what makes them; None for
        random vectors, which only multigrid begins with.
    values
        (q,) Ritz values of `start`, if its columns are mass-orthonormal Ritz vectors orthogonal to
        the rigid motions; otherwise a Rayleigh-Ritz step makes such of them first.
    tolerance
        Largest accepted relative eigenvalue error, as estimated from the residual; the median has
        to reach a tenth of it.
    max_steps
        Steps allowed; reaching `tolerance` within them is not required when `tolerance` is zero.
    report
        Called with the step and the largest estimated error of the wanted modes.
    observe
        Called with the step and the Ritz values of the wanted modes.
    similar
        Inverse for a similar material, which does for the steps of a nearly accurate start.
    begun
        Block Lanczos iteration that `start` and `values` come from.
    keep
        Whether a correction that does not reach `tolerance`, stagnates, or has a linear system that
        `linear` cannot solve returns what it has.

    Notes
    -----
    The residual r = K x - theta M x of a Ritz pair bounds the relative error of theta, to second
    order, by r^T M^-1 r / (theta (theta_p - theta)), where theta_p is the last value that is
    improved.  M is replaced by its row sums, of a consistent mass by half of them.

    With a direct solver and anything but `relaxation` the shift mu lies in the middle of the wanted
    spectrum: the last modes converge like (theta - mu) / (theta_p - mu), and the first are accurate
    early.  Otherwise it lies below the spectrum.
    """
    if acceleration == "lanczos" and linear.method == "amg-cg":
        result = _by_gradients(system, start, requested, linear, tolerance, max_steps, report)
        if result.errors.max() > tolerance > 0.0 and not keep:
            raise ConvergenceError(
                f"conjugate gradients reached an eigenvalue error of {result.errors.max():.1e} "
                f"after {result.steps} steps, {tolerance:.1e} was asked for; allow more steps "
                "(--corrections), or use --method lanczos"
            )
        return result
    start = start() if callable(start) else start
    assert start is not None
    rough = values is not None and begun is None
    if values is None:
        values, start = rayleigh_ritz(system, start)
    if len(values) < requested:
        raise ConvergenceError(
            f"the start block spans {len(values)} elastic modes, {requested} are wanted; keep more"
        )
    if observe is not None:
        observe(0, values[:requested])
    if len(values) == system.n_dofs - system.rigid.shape[1]:
        return _whole(values, start, requested)
    ritz = Ritz(system, values, start)
    iteration = SubspaceIteration(system, linear, ritz, requested, acceleration, similar)
    if begun is not None:
        iteration.go_on_from(begun)
    try:
        result = iteration.run(tolerance, max_steps, rough, report, observe, keep)
        result.inverse = iteration.lasting(tolerance)
    finally:
        iteration.destroy()
    return result


def _by_gradients(
    system: System,
    start: Array | Callable[[], Array] | None,
    requested: int,
    linear: LinearSolver,
    tolerance: float,
    max_steps: int,
    report: Callable[[int, float], None] | None,
) -> Correction:
    """What multigrid does best: many cheap steps, each with one cycle of it.

    Where one step's blocks would be all of the space, its Ritz pairs are taken at once.
    """
    width = requested + default_guard(requested)
    if BLOCKS_OF_A_STEP * width >= system.n_dofs - system.rigid.shape[1]:
        values, vectors = rayleigh_ritz(system, every_unknown(system))
        if len(values) < requested:
            raise ConvergenceError(
                f"{len(values)} elastic modes of {system.n_dofs} unknowns could be told apart, "
                f"{requested} are wanted; ask for fewer --modes or use --method auto"
            )
        return _whole(values[:width], vectors[:, :width], requested)
    inverse = linear.iterative(system, -safe_shift(system))
    precondition = inverse.precondition

    def first_block() -> Array:
        if start is None:
            return precondition(system.times_mass(start_block(system, width, 0)))
        return (start() if callable(start) else start)[:, :width]

    give_back_freed_memory()  # of setting up multigrid, as much as the blocks to come
    try:
        return lobpcg(
            system,
            precondition,
            first_block(),  # which nothing here holds while the iteration goes on
            requested,
            tolerance,
            max_steps,
            report,
        )
    finally:
        inverse.destroy()
        give_back_freed_memory()


def _whole(values: Array, vectors: Array, requested: int) -> Correction:
    exact = np.full(requested, np.finfo(float).eps)
    lowest = np.ascontiguousarray(vectors[:, :requested])
    return Correction(values[:requested], lowest, exact, vectors[:, requested:])
