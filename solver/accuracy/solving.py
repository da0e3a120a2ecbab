"""The modes of a solid as accurate as is requested: refined, at a resolution that is enough."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any

import numpy as np

from carillon.errors import UserError, on_all_ranks
from carillon.fem.materials import NAMES
from carillon.fem.model import ElasticModel, Solid, fine_model
from carillon.parameters import option, parameters
from carillon.parameters.quantities import between
from carillon.processes.mpi import MPI
from solver.accuracy.divide import DividedCells, solve_refined
from solver.accuracy.voxels import Reference
from solver.analysis.modes import Modes
from solver.analysis.options import SolverOptions
from solver.analysis.phases import RankClock
from solver.analysis.problem import Problem, ProblemOptions, build_problem
from solver.analysis.solid_surface import SolidSurface
from solver.distribution.collective import bcast_from_root, compute_on_root, optional
from solver.files.modes_file import ESTIMATE, FINE_TAKEN, read_modes
from solver.refinement.coarse_or_fine import solve_coarsened
from solver.refinement.errors import (
    DIVIDED_CELLS,
    FINE_BLOCKS,
    FROM_FINE,
    FROM_SOLID,
    LAST,
    WORST,
    ExpectedErrors,
    RefinementStep,
)
from solver.refinement.model_solver import SolveModel
from solver.refinement.refined_model import RefinedModel

MOST_UNKNOWNS = 400_000
"""Largest number of unknowns of a lattice that is tried."""
UNTOLD = "how far frequencies are from the solid's cannot be told"
"""Warning where the estimate fails."""
LEAST_STEP, LARGEST_STEP = 1.2, 2.0
"""Least and largest factor by which a resolution is raised."""
FIRST_RESOLUTION = 16
"""First resolution of a search for an accurate one."""
SOLID = "solid"
"""Phase in which rank 0 reads the mesh, assigns the material and coarsens."""


@dataclass
class Solved:
    """A solid's modes."""

    solid: ProblemOptions
    """The solid, at the resolution that was solved."""
    problem: Problem | None
    model: Solid | None
    """The discretised solid, and the model of it that was solved; on rank 0, None on the others."""
    modes: Modes
    achieved: dict[str, Any]
    """Plain values: what is expected of the frequencies' errors; `fine_taken` is why the fine solid
    was taken for a coarse one, if that is so."""


@dataclass(frozen=True)
class AccuracyRequest:
    """How accurate the modes of a solid shall be."""

    accuracy: float | None = None
    """Expected distance from the solid's frequencies down to which the resolution is raised; None
    to leave it."""
    refine_to: float | None = None
    """Expected error down to which a coarse mesh or finite cells are refined; None to leave
    them."""
    estimated: bool = False
    start: str | None = None
    """Modes file whose refined mesh is begun from."""


def solve_solid(
    solid: ProblemOptions,
    solve: SolveModel,
    options: SolverOptions,
    request: AccuracyRequest,
    comm: MPI.Comm = MPI.COMM_WORLD,
    report: Callable[[RefinementStep], None] | None = None,
    clock: RankClock | None = None,
) -> Solved:
    """Modes of a solid, as accurate as requested, and their expected errors; collective.

    `solve` finds the modes of a model by the `options`, which coarse models are weighed by. The
    `clock` of the run counts what is done besides. Raises UserError for anything wrong with the
    solid, and if it would be too large to be so accurate.
    """
    search = _Search(solve, options, request, comm, report, clock or RankClock(comm))
    solved = search.solved(solid)
    while (resolution := search.resolution_after(solved)) is not None:
        solved.modes.destroy()
        surface = None if solved.problem is None else solved.problem.surface
        solved = search.solved(replace(solved.solid, resolution=resolution), surface)
    return solved


@dataclass(frozen=True)
class _Search:
    solve: SolveModel
    options: SolverOptions
    request: AccuracyRequest
    comm: MPI.Comm
    report: Callable[[RefinementStep], None] | None
    clock: RankClock

    def solved(self, solid: ProblemOptions, surface: SolidSurface | None = None) -> Solved:
        """Modes at one resolution; the surface on rank 0 if it was read before."""
        phase = self.clock(SOLID)
        problem = compute_on_root(self.comm, lambda: build_problem(solid, surface), phase)
        estimated, tolerance = self.request.estimated, self.request.refine_to
        cells = solid.discretisation == "finite-cell"
        if tolerance is None and cells and estimated:
            tolerance = np.inf
        if tolerance is None:
            model = None if problem is None else problem.model
            solved = Solved(solid, problem, model, self.solve(model), {})
        elif cells:
            solved = self._divided(solid, problem, tolerance)
        else:
            solved = self._coarsened(solid, problem, tolerance)
        if estimated and solid.discretisation == "voxel":
            distance = partial(self._distance_of_voxels, solved)
            with self.clock(ESTIMATE):
                solved.achieved |= optional(self.comm, UNTOLD, distance) or {}
        return solved

    @on_all_ranks()
    def resolution_after(self, solved: Solved) -> int | None:
        """The next resolution to try; None if the frequencies are near enough to the solid's."""
        accuracy, solid = self.request.accuracy, solved.solid
        if accuracy is None:
            return None
        if f"{FROM_SOLID}_rms" not in solved.achieved:
            raise UserError(
                "--accuracy needs a distance from the solid, which could not be told; give a "
                "higher --resolution to begin with"
            )
        rms, worst = (solved.achieved[f"{FROM_SOLID}_{name}"] for name in ("rms", "worst"))
        excess = max(rms, abs(worst) / WORST) / accuracy
        if excess <= 1.0:
            # Cells need not be divided as far as without an accuracy.
            solved.achieved.pop("missed_accuracy", None)
            return None
        if solid.material not in NAMES:
            raise UserError(
                f"--accuracy {accuracy:g} needs a higher --resolution than {solid.resolution}, and "
                f"{solid.material} is of the voxels of that one"
            )
        unknowns = self.comm.bcast(None if solved.model is None else solved.model.n_dofs)
        factor = float(np.clip(np.sqrt(excess), LEAST_STEP, LARGEST_STEP))
        if unknowns * factor**2 > MOST_UNKNOWNS:
            raise UserError(
                f"--accuracy {accuracy:g} needs more than {MOST_UNKNOWNS:,} unknowns; --resolution "
                f"{solid.resolution} is expected to be {rms:.2g} off, worst {worst:+.2g}"
            )
        return int(np.ceil(factor * solid.resolution))

    def _divided(self, solid: ProblemOptions, problem: Problem | None, tolerance: float) -> Solved:
        start: DividedCells | None = compute_on_root(self.comm, lambda: _undivided(problem))
        model, modes, steps = solve_refined(self.solve, start, tolerance, self.comm, self.report)
        achieved: dict[str, Any] = {}
        if steps:
            achieved = steps[-1].errors.attributes(FROM_SOLID)
            achieved |= {DIVIDED_CELLS: steps[-1].refined, "refinement_steps": len(steps) - 1}
            if steps[-1].errors.excess(tolerance) > 1.0:
                achieved["missed_accuracy"] = tolerance
        return Solved(solid, problem, model, modes, achieved)

    def _coarsened(
        self, solid: ProblemOptions, problem: Problem | None, tolerance: float
    ) -> Solved:
        """A coarse model, refined as in the file to start from, or the fine one."""
        comm, start = self.comm, self.request.start
        refined = compute_on_root(comm, lambda: _coarse(solid, problem, start))
        result = solve_coarsened(self.solve, refined, tolerance, self.options, comm, self.report)
        achieved = {} if result.errors is None else result.errors.attributes(FROM_FINE)
        achieved |= {"refinement_steps": max(len(result.steps) - 1, 0)}
        if result.reason is not None:
            blocks = comm.bcast(None if refined is None else refined.all_blocks)
            achieved |= {FINE_BLOCKS: blocks, FINE_TAKEN: result.reason}
        elif result.errors is not None:
            achieved |= {FINE_BLOCKS: result.steps[-1].refined}
        else:
            achieved |= {FINE_BLOCKS: comm.bcast(None if refined is None else refined.fine_blocks)}
        return Solved(solid, problem, result.model, result.modes, achieved)

    def _distance_of_voxels(self, solved: Solved) -> dict[str, Any]:
        cells = compute_on_root(self.comm, lambda: _reference(solved))
        reference = self.solve(None if cells is None else cells.model, LAST)
        modes = reference.system.gather(reference.vectors)

        def errors() -> ExpectedErrors:
            assert cells is not None and modes is not None
            return cells.errors(solved.modes.values, reference.values, modes)

        try:
            return bcast_from_root(self.comm, errors).attributes(FROM_SOLID)
        finally:
            reference.destroy()


def _reference(solved: Solved) -> Reference:
    assert solved.problem is not None
    return Reference.of_voxels(solved.solid, solved.problem)


def _undivided(problem: Problem | None) -> DividedCells:
    assert problem is not None and problem.covering is not None
    return DividedCells(problem.covering, problem.finite_cells, problem.placed_on)


def _coarse(solid: ProblemOptions, problem: Problem | None, start: str | None) -> RefinedModel:
    """The coarse model to begin with, with those blocks fine that are in the file `start`."""
    assert problem is not None
    coarsening = solid.coarsening(problem.regions)
    assert coarsening is not None
    mesh = None if start is None else read_modes(start, with_modes=False).mesh
    return RefinedModel(_fine(problem), coarsening, mesh)


def _fine(problem: Problem) -> ElasticModel:
    return fine_model(problem.fine, problem.young, problem.region, **problem.hexahedra.constants)


@parameters
class DistanceOptions:
    """Which distance from the solid's frequencies is asked for, and whether it is estimated."""

    accuracy: Annotated[float, between(1e-05, 1.0)] | None = option(
        None,
        "raise the resolution until frequencies are expected to be so near to the solid's: the "
        "root mean square of the relative errors, and a third of the worst "
        f"(from --resolution, or {FIRST_RESOLUTION})",
        metavar="ERROR",
    )
    estimate: bool | None = option(
        None,
        "estimate how far frequencies are from the solid's; voxels are compared with finite cells "
        "(default: unless a mesh is coarsened, or for slepc and arpack)",
    )

    def is_estimated(self, solid: ProblemOptions, solver: SolverOptions) -> bool:
        """Whether the distance from the solid is estimated.

        Raises UserError if it is not to be, and an accuracy is asked for.
        """
        if self.accuracy is not None:
            if self.estimate is False:
                raise UserError("--accuracy goes by the estimate: leave out --no-estimate")
            return True
        if self.estimate is not None:
            return self.estimate
        return solid.coarsen == "none" and not solver.is_general
