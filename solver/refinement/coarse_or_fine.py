"""The modes of a coarse model if it is near enough and saves work, or those of the fine solid.

What a coarse model costs is known before it is solved, but for whether it is good enough: unknowns
and modes tell the work of its analysis, of the estimate of its errors, and of the fine analysis.
Where the first two are not clearly less than the last, the fine solid is solved at once. Where the
estimate finds errors that are too large, blocks stay fine if the refined model is clearly less work
too; or else the fine solid is solved from the coarse modes, with the estimate's factorisation. All
that is decided from counts, moduli and modes, so every machine decides the same. Where the fine
solid cannot be solved, for lack of memory for example, the coarse modes stand, with a warning.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from carillon.fem.model import ElasticModel
from carillon.processes.mpi import MPI
from solver.analysis.modes import Modes
from solver.analysis.options import SolverOptions
from solver.distribution.collective import bcast_from_root, compute_on_root, optional
from solver.refinement.errors import LAST, ExpectedErrors, RefinementStep
from solver.refinement.estimate import ErrorEstimate, estimate_errors
from solver.refinement.inverse_iteration import FineStart, InverseIteration
from solver.refinement.model_solver import SolveModel
from solver.refinement.refined_model import RefinedModel
from solver.refinement.weighing import Weighing

UNTOLD = "how far frequencies are off cannot be told"
"""Reason for the fine solid where an estimate fails."""


@dataclass
class CoarseOrFine:
    """A solid's modes."""

    model: ElasticModel | None
    """The model that was solved last, on rank 0."""
    modes: Modes
    steps: list[RefinementStep]
    """Coarse models that were rated; none if the fine solid was taken at once."""
    reason: str | None
    """Why the fine solid was taken, as a clause; None for a coarse model."""
    errors: ExpectedErrors | None
    """Expected errors of the frequencies; None if they could not be estimated."""


def solve_coarsened(
    solve: SolveModel,
    refined: RefinedModel | None,
    tolerance: float,
    options: SolverOptions,
    comm: MPI.Comm = MPI.COMM_WORLD,
    report: Callable[[RefinementStep], None] | None = None,
) -> CoarseOrFine:
    """Modes of a coarse model with an expected error of at most `tolerance`, or of the fine one.

    Collective.  If neither can be had, those of the last coarse model, with a warning.

    Parameters
    ----------
    refined
        Coarse model to begin with, on rank 0; None on the others.
    tolerance
        For the root mean square of the relative errors of frequencies 7 to 60; the worst may be
        three times as large.
    options
        What `solve` computes and how, which the work is reckoned from.

    Examples
    --------
    >>> from carillon.fem.geometry import builtin_surface, hexmesh_from_voxels, voxelize
    >>> from carillon.fem.model import fine_model
    >>> from solver import SolverOptions
    >>> from solver.coarsening.choice import make_coarsening
    >>> from solver.refinement.model_solver import SolveByOptions
    >>> mesh = hexmesh_from_voxels(voxelize(builtin_surface("bar"), 16))
    >>> fine = fine_model(mesh, np.full(mesh.n_cells, 1e9))
    >>> coarse = RefinedModel(fine, make_coarsening("ddfem"))
    >>> options = SolverOptions(modes=20)
    >>> result = solve_coarsened(SolveByOptions(options), coarse, 0.05, options)
    >>> result.reason
    'the fine solid has so few unknowns that a coarse one and its check would save little'
    >>> result.model.n_dofs == fine.n_dofs, result.errors.rms
    (True, 0.0)
    """
    weighing = None if refined is None else Weighing(refined, tolerance, options)
    fine = None if refined is None else refined.fine
    solid: InverseIteration | None = None
    start: FineStart | None = None
    coarse: CoarseOrFine | None = None
    steps: list[RefinementStep] = []
    reason = bcast_from_root(comm, lambda: _on_root(weighing).before())
    while reason is None:
        model = None if refined is None else refined.model
        modes = solve(model)
        if solid is None:
            solid = InverseIteration(fine, comm)
        blocks = None if refined is None else refined.blocks
        rating = partial(estimate_errors, solid, blocks, modes)
        estimate = optional(comm, f"the fine solid is taken, since {UNTOLD}", rating)
        if estimate is None:
            coarse = CoarseOrFine(model, modes, steps, None, None)
            reason = UNTOLD
            break
        step, done, reason = bcast_from_root(comm, partial(_weighed, weighing, estimate))
        steps.append(step)
        if report is not None and comm.rank == 0:
            report(step)
        if done:
            solid.destroy()
            return CoarseOrFine(model, modes, steps, None, estimate.errors)
        if reason is None:
            reason = _refine(weighing, solid, estimate, comm)
        if reason is not None:
            whole = modes.system.gather(np.ascontiguousarray(modes.vectors[:, modes.rigid :]))
            start = FineStart(solid, modes.values[modes.rigid :], blocks, whole)
            coarse = CoarseOrFine(model, modes, steps, None, estimate.errors)
        else:
            modes.destroy()
    solve_fine = partial(solve, fine, start=start)
    if coarse is None:
        modes = solve_fine()
    else:
        better = optional(comm, "the modes are those of the coarse model", solve_fine)
        if better is None:
            return coarse
        coarse.modes.destroy()
        modes = better
    if solid is not None:
        solid.destroy()
    none = np.zeros(max(min(LAST, len(modes.values)) - modes.rigid, 1))
    return CoarseOrFine(fine, modes, steps, reason, ExpectedErrors(none, modes.rigid))


def _weighed(
    weighing: Weighing | None, estimate: ErrorEstimate
) -> tuple[RefinementStep, bool, str | None]:
    """The model that was rated, whether it is good enough, and why it cannot be refined if not."""
    weighing = _on_root(weighing)
    return weighing.step(estimate.errors), *weighing.after(estimate)


def _refine(
    weighing: Weighing | None, solid: InverseIteration, estimate: ErrorEstimate, comm: MPI.Comm
) -> str | None:
    """Keep blocks fine; why the refined model is not worth solving, if that is so."""
    count = len(estimate.errors.errors)
    vectors = solid.whole(estimate.fine.vectors[:, :count])
    compute_on_root(comm, lambda: _on_root(weighing).refine(estimate, vectors))
    return bcast_from_root(comm, lambda: _on_root(weighing).after_refining())


def _on_root(weighing: Weighing | None) -> Weighing:
    assert weighing is not None
    return weighing
