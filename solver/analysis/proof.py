"""Ground truth by a general eigensolver, its completion by a count, and the proof of all modes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from carillon.arrays import Array
from solver.analysis.options import SolverOptions
from solver.analysis.phases import Phases, largest_peak_memory
from solver.assembly.system import System
from solver.reference.truth import (
    RESIDUAL_TOLERANCE,
    SPARE_MODES,
    Truth,
    can_count,
    complete,
    count_beyond,
    solve_truth,
)
from solver.verification.residuals import (
    require_orthonormal,
    require_rigid,
    rigid_modes,
    verify,
)


def ground_truth(
    system: System, options: SolverOptions, phases: Phases, evidence: dict[str, Any]
) -> Truth:
    """Eigenpairs by SLEPc or ARPACK, counted unless `options` say that they need not be.

    What was found goes into `evidence`, the seconds into `phases`. Raises ConvergenceError, see
    `solver.reference.truth.solve_truth` and `complete`.
    """
    counting = options.check_inertia is not False
    with phases("eigensolver"):
        truth = solve_truth(
            system,
            options.modes,
            options.method,
            options.tolerance or RESIDUAL_TOLERANCE,
            SPARE_MODES if counting and can_count() else 0,
            options.seed,
        )
    if counting:
        truth = completed(system, truth, options, phases, evidence)
    evidence |= {
        "eigensolver_iterations": truth.iterations,
        "further_searches": truth.searches,
        "modes_added": truth.added,
    }
    return truth


def completed(
    system: System,
    truth: Truth,
    options: SolverOptions,
    phases: Phases,
    evidence: dict[str, Any],
    count: Callable[[System, float], int] | None = None,
) -> Truth:
    """`truth` with the modes that it lacked, which a count of the eigenvalues tells.

    `count` counts the eigenvalues below a value; MUMPS does where it is None.
    """
    inertia = None
    if count is not None or can_count():
        with phases("inertia"):
            inertia = count_beyond(system, truth, count)
    if inertia is None or inertia.counted != inertia.computed:
        tolerance = options.tolerance if options.is_general else None
        with phases("completion"):
            truth, inertia = complete(
                system, truth, inertia, tolerance or RESIDUAL_TOLERANCE, options.seed
            )
    if inertia is not None:
        evidence |= {
            "inertia_at": inertia.value,
            "inertia_count": inertia.counted,
            "inertia_expected": inertia.computed,
        }
    return truth


def prove(
    system: System,
    values: Array,
    vectors: Array,
    exact: bool,
    phases: Phases,
    evidence: dict[str, Any],
) -> Array:
    """Residual ratios (k,) of eigenpairs, whose properties go into `evidence`; collective.

    `exact` ones shall be eigenpairs, not just approximations of some. Raises ConvergenceError if
    the modes are not orthonormal, or exact ones do not have the rigid motions that supports leave.
    """
    with phases("verification"):
        residuals, orthogonality = verify(system, values, vectors)
    evidence |= {
        "orthogonality": orthogonality,
        "residual_max": float(residuals.max()),
        "rigid_modes": rigid_modes(system, values, vectors),
        "peak_memory_bytes": largest_peak_memory(system.comm),
    }
    require_orthonormal(orthogonality)
    if exact:
        require_rigid(evidence["rigid_modes"], system.n_rigid)
    return residuals
