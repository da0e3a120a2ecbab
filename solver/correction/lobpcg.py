"""Locally optimal block preconditioned conjugate gradients (Knyazev 2001), without a factorisation.

Every step takes the lowest Ritz pairs of the span of the vectors X, their preconditioned residuals
W, and the direction P that the last step took.  A cycle of multigrid is the preconditioner.
"""

from collections.abc import Callable

import numpy as np

from carillon.arrays import Array
from carillon.errors import ConvergenceError
from solver.assembly.system import System
from solver.correction.result import Correction
from solver.correction.trial_space import TrialSpace

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
    basis = TrialSpace(system, start)
    del start  # as large as the modes
    count = len(basis.values)
    if count < requested:
        raise ConvergenceError(
            f"the start block spans {count} elastic modes, {requested} are wanted; keep more"
        )
    errors, before = np.full(count, np.inf), np.full(count, np.inf)
    active = np.arange(count)
    history: list[float] = []
    solves = 0
    for step in range(max_steps + 1):
        energy = basis.add_residuals(active, precondition)
        solves += len(active)
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
        active = active[moving]
        basis.step(moving, active)
    vectors = basis.vectors()
    if vectors.shape[1] < requested:
        raise ConvergenceError(
            f"{vectors.shape[1]} of {requested} modes are left after {step} steps, others became "
            "linearly dependent; use --method auto"
        )
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
