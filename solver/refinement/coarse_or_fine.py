"""The modes of a coarse model if it is near enough and saves work, or those of the fine solid.

What a coarse model costs is known before it is solved, but for whether it is good enough: unknowns
and modes tell the work of its analysis, of the estimate of its errors, and of the fine analysis.
Where the first two are not clearly less than the last, the fine solid is solved at once. Where the
estimate finds errors that are too large, blocks stay fine if the refined model is clearly less work
too; or else the fine solid is solved from the coarse modes, with the estimate's factorisation. All
that is decided from counts, moduli and modes, so every machine decides the same. Where the fine
solid cannot be solved, for lack of memory for example, the coarse modes stand, with a warning.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from carillon.fem.geometry import Blocks
from carillon.fem.model import RIGID_MODES, ElasticModel
from solver.analysis.coarse_start import prolonged
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.modes import Modes
from solver.analysis.options import RANDOM, SolverOptions
from solver.analysis.prepared import Prepared
from solver.correction.random_start import Approximation
from solver.correction.shift import is_amid
from solver.distribution.collective import bcast_from_root, compute_on_root, optional
from solver.files.initial_modes import scatter_rows
from solver.refinement import work
from solver.refinement.errors import LAST, WORST, ExpectedErrors
from solver.refinement.estimate import ErrorEstimate, estimate_errors, mean_shares
from solver.refinement.inverse_iteration import InverseIteration
from solver.refinement.refine import RefinementStep
from solver.refinement.refined_model import RefinedModel

Array = NDArray[np.float64]

UNTOLD = "how far frequencies are off cannot be told"
"""Why the fine solid is taken where an estimate fails."""


@dataclass
class FineStart:
    """What a coarse model that was not good enough leaves for the fine analysis.

    Attributes
    ----------
    solid
        The fine solid that it was rated by.
    values
        (q,) elastic eigenvalues [rad^2/s^2] of the coarse model.
    blocks, modes
        The coarse mesh, and its modes (coarse n_dofs, q), on rank 0.
    """

    solid: InverseIteration
    values: Array
    blocks: Blocks | None
    modes: Array | None

    @property
    def prepared(self) -> Prepared:
        """Partition and analysis of the fine mesh."""
        return self.solid.prepared

    def begin(self, solver: ModalSolver) -> Approximation | None:
        """What an analysis of the fine solid may start from; None if it has no use for it."""
        requested = solver.options.modes - RIGID_MODES
        if solver.options.method not in RANDOM or solver.options.check_inertia:
            return None
        given = self.blocks is not None and self.modes is not None
        columns = prolonged(self.blocks, self.modes) if given else []  # type: ignore[arg-type]
        rows = scatter_rows(columns, len(self.values), solver.local_mesh, solver.comm)
        inverse = self.solid.inverse
        if solver.local_mesh is not self.prepared.local_mesh or inverse is None:
            inverse = None
        elif not self.prepared.linear.indefinite or not is_amid(inverse, requested):
            inverse = None
        else:
            self.solid.inverse = None  # The analysis frees it.
        return Approximation(self.values, rows, inverse)


class SolveCoarse(Protocol):
    """Finds the modes of a coarse model, or of the fine one with a start if there is one."""

    def __call__(self, model: ElasticModel | None, *, start: FineStart | None = None) -> Modes:
        """Collective; the model is None but on rank 0."""


def by_options(options: SolverOptions, comm: MPI.Comm = MPI.COMM_WORLD) -> SolveCoarse:
    """Finds modes as these options say."""

    def solve(model: ElasticModel | None, *, start: FineStart | None = None) -> Modes:
        prepared = None if start is None else start.prepared
        solver = ModalSolver(model, options, comm, prepared=prepared)
        return solver.solve(initial_modes=None if start is None else start.begin(solver))

    return solve


@dataclass
class CoarseOrFine:
    """A solid's modes.

    Attributes
    ----------
    model
        That was solved last, on rank 0.
    modes
        Of the model.
    steps
        Coarse models that were rated; none if the fine solid was taken at once.
    reason
        Why the fine solid was taken, as a clause; None for a coarse model.
    errors
        Expected of the frequencies; None if they cannot be told.
    """

    model: ElasticModel | None
    modes: Modes
    steps: list[RefinementStep]
    reason: str | None
    errors: ExpectedErrors | None


def solve_coarsened(
    solve: SolveCoarse,
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
    report
        Called on rank 0 after each estimate.

    Examples
    --------
    >>> from carillon.fem.geometry import builtin_surface, hexmesh_from_voxels, voxelize
    >>> from carillon.fem.model import fine_model
    >>> from solver import SolverOptions
    >>> from solver.coarsening.choice import make_coarsening
    >>> mesh = hexmesh_from_voxels(voxelize(builtin_surface("bar"), 16))
    >>> fine = fine_model(mesh, np.full(mesh.n_cells, 1e9))
    >>> coarse = RefinedModel(fine, make_coarsening("ddfem"))
    >>> options = SolverOptions(modes=20)
    >>> found = solve_coarsened(by_options(options), coarse, 0.05, options)
    >>> found.reason
    'the fine solid has so few unknowns that a coarse one and its check would save little'
    >>> found.model.n_dofs == fine.n_dofs, found.errors.rms
    (True, 0.0)
    """
    choice = None if refined is None else _Weighing(refined, tolerance, options)
    solid: InverseIteration | None = None
    start: FineStart | None = None
    coarse: CoarseOrFine | None = None
    steps: list[RefinementStep] = []
    reason = bcast_from_root(comm, lambda: _of(choice).before())
    while reason is None:
        model = None if refined is None else refined.model
        found = solve(model)
        if solid is None:
            solid = InverseIteration(None if refined is None else refined.fine, comm)
        blocks = None if refined is None else refined.blocks
        rating = partial(estimate_errors, solid, blocks, found)
        estimate = optional(comm, f"the fine solid is taken, since {UNTOLD}", rating)
        if estimate is None:
            coarse = CoarseOrFine(model, found, steps, None, None)
            reason = UNTOLD
            break
        step = bcast_from_root(comm, partial(_step, choice, estimate))
        steps.append(step)
        if report is not None and comm.rank == 0:
            report(step)
        done, reason = bcast_from_root(comm, partial(_after, choice, estimate))
        if done:
            solid.destroy()
            return CoarseOrFine(model, found, steps, None, estimate.errors)
        if reason is None:
            reason = _refined(choice, solid, estimate, comm)
        if reason is not None:
            whole = found.system.gather(np.ascontiguousarray(found.vectors[:, RIGID_MODES:]))
            start = FineStart(solid, found.values[RIGID_MODES:], blocks, whole)
            coarse = CoarseOrFine(model, found, steps, None, estimate.errors)
        else:
            found.destroy()
    fine = None if refined is None else refined.fine
    solve_fine = partial(solve, fine, start=start)
    if coarse is None:
        found = solve_fine()
    else:
        better = optional(comm, "the modes are those of the coarse model", solve_fine)
        if better is None:
            return coarse
        coarse.modes.destroy()
        found = better
    if solid is not None:
        solid.destroy()
    none = np.zeros(max(min(LAST, len(found.values)) - RIGID_MODES, 1))
    return CoarseOrFine(fine, found, steps, reason, ExpectedErrors(none))


def _refined(
    choice: _Weighing | None, solid: InverseIteration, estimate: ErrorEstimate, comm: MPI.Comm
) -> str | None:
    """Keep blocks fine; why not, if that is so."""
    count = len(estimate.errors.errors)
    vectors = solid.whole(estimate.fine.vectors[:, :count])
    compute_on_root(comm, lambda: _of(choice).refine(estimate, vectors))
    return bcast_from_root(comm, lambda: _of(choice).after_refining())


def _step(choice: _Weighing | None, estimate: ErrorEstimate) -> RefinementStep:
    return _of(choice).step(estimate.errors)


def _after(choice: _Weighing | None, estimate: ErrorEstimate) -> tuple[bool, str | None]:
    return _of(choice).after(estimate)


def _of(choice: _Weighing | None) -> _Weighing:
    assert choice is not None
    return choice


class _Weighing:
    """What rank 0 decides, and the work that was spent so far."""

    def __init__(self, refined: RefinedModel, tolerance: float, options: SolverOptions) -> None:
        self._refined = refined
        self._tolerance = tolerance
        self._options = options
        self._fine_work = self._analysis_work(refined.fine.n_dofs)
        self._spent = 0.0
        self._excuse = ""

    def before(self) -> str | None:
        """Why the fine solid is to be solved at once."""
        refined = self._refined
        if refined.is_fine_given:
            return "the modes to start from are those of the fine solid"
        if refined.is_given:
            return None
        if not work.is_followed(refined.blocks, refined.young):
            ratio = work.variation(refined.blocks, refined.young)
            return (
                "the material varies from voxel to voxel, by a factor of "
                f"{ratio:,.0f} in a typical block, which coarse elements cannot follow"
            )
        unknowns, options = (refined.fine.n_dofs, refined.n_dofs), self._options
        if not work.is_clearly_less(*unknowns, options.modes, options.method):
            return (
                "the fine solid has so few unknowns that a coarse one and its check would save "
                "little"
            )
        return None

    def step(self, errors: ExpectedErrors) -> RefinementStep:
        """The model as it is now, and what is expected of it."""
        return RefinementStep(self._refined.n_dofs, self._refined.fine_blocks, errors)

    def after(self, estimate: ErrorEstimate) -> tuple[bool, str | None]:
        """Whether the model is good enough, and if not, why it cannot be refined."""
        self._spent += self._coarse_work() + self._estimate_work()
        missed, errors = estimate.fine.missed, estimate.errors
        if errors.excess(self._tolerance) <= 1.0:
            lacks = "1 mode" if missed == 1 else f"{missed} modes"
            return (
                not missed,
                f"the coarse model lacks {lacks} of the fine solid" if missed else None,
            )
        self._excuse = (
            f"the coarse model's frequencies are expected to be {errors.rms:.1%} off "
            f"({100 * self._tolerance:g}% allowed), the worst {errors.worst:+.1%} "
            f"({100 * WORST * self._tolerance:g}% allowed, mode {errors.worst_mode}), and keeping "
            "blocks fine would save little"
        )
        return False, self.after_refining()

    def refine(self, estimate: ErrorEstimate, vectors: Array | None) -> None:
        """Keep fine the elements that are to blame, by modes (n_dofs, k) of the fine solid."""
        assert vectors is not None
        refined, values = self._refined, estimate.fine.values[: vectors.shape[1]]
        shares = mean_shares(refined.blocks, refined.model, refined.fine, values, vectors)
        refined.refine(shares, estimate.errors.excess(self._tolerance))

    def after_refining(self) -> str | None:
        """Why the model as it is now is not worth solving."""
        total = self._spent + self._coarse_work() + self._estimate_work()
        return self._excuse if total > work.REFINED * self._fine_work else None

    def _coarse_work(self) -> float:
        return self._analysis_work(self._refined.n_dofs)

    def _analysis_work(self, unknowns: int) -> float:
        return work.analysis_work(unknowns, self._options.modes, self._options.method)

    def _estimate_work(self) -> float:
        return work.estimate_work(self._refined.fine.n_dofs, again=self._spent > 0.0)
