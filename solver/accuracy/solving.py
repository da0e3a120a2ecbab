"""Solve a solid, refine it where that is asked for, and tell how far it is from the truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Protocol

import numpy as np
from mpi4py import MPI

from carillon.errors import UserError, on_all_ranks
from carillon.fem.materials import NAMES
from carillon.fem.model import ElasticModel, Solid, fine_model
from solver.accuracy.divide import DividedCells
from solver.accuracy.voxels import Reference
from solver.analysis.modes import Modes
from solver.analysis.options import SolverOptions
from solver.analysis.problem import Problem, ProblemOptions, build_problem
from solver.distribution.collective import bcast_from_root, compute_on_root, optional
from solver.files.modes_file import FINE_TAKEN, read_modes
from solver.refinement.coarse_or_fine import FineStart, solve_coarsened
from solver.refinement.errors import FROM_FINE, FROM_SOLID, LAST, WORST, ExpectedErrors
from solver.refinement.refine import Refinable, RefinementStep, solve_refined
from solver.refinement.refined_model import RefinedModel

MOST_UNKNOWNS = 400_000
"""Unknowns from which no finer lattice is tried."""
FINE, DIVIDED = "fine_blocks", "divided_cells"
"""Attributes that count what was refined."""
UNTOLD = "how far frequencies are from the solid's cannot be told"
"""What is said where the estimate fails."""
LEAST_STEP, LARGEST_STEP = 1.2, 2.0
"""Factors by which a resolution is raised."""


class Solve(Protocol):
    """Finds modes of a model, as many as are asked for, or `modes` if they are fewer."""

    def __call__(
        self, model: Solid | None, modes: int | None = None, start: FineStart | None = None
    ) -> Modes:
        """Collective; the model is None but on rank 0, and the start is for the fine solid."""


@dataclass
class Solved:
    """A solid's modes.

    Attributes
    ----------
    problem, model
        The solid, and the model of it that was solved; on rank 0, None on the others.
    modes
        Of the model.
    achieved
        Plain values: what is expected of the frequencies' errors; `fine_taken` is why the fine
        solid was taken for a coarse one, if that is so.
    """

    problem: Problem | None
    model: Solid | None
    modes: Modes
    achieved: dict[str, Any]


@dataclass(frozen=True)
class Wishes:
    """What is asked for of a solid's modes.

    Attributes
    ----------
    refine_to
        Expected error down to which a coarse mesh or finite cells are refined; None for as they
        are.
    estimated
        Whether the distance from the solid is to be told.
    start
        Modes file whose refined mesh is begun from.
    options
        What `solve` computes and how, which a coarse model is weighed by; needed to refine one.
    """

    refine_to: float | None = None
    estimated: bool = False
    start: str | None = None
    options: SolverOptions | None = None


def solve_solid(
    described: ProblemOptions,
    solve: Solve,
    wishes: Wishes,
    comm: MPI.Comm = MPI.COMM_WORLD,
    report: Callable[[str, RefinementStep], None] | None = None,
) -> Solved:
    """Modes of a solid and what they are expected to be off; collective.

    Parameters
    ----------
    report
        Called on rank 0 with what was refined and each step of it.

    Raises
    ------
    UserError
        For anything wrong with the solid.
    """
    problem = compute_on_root(comm, lambda: build_problem(described))
    cells = described.discretisation == "finite-cell"
    tolerance = wishes.refine_to
    if tolerance is None and cells and wishes.estimated:
        tolerance = np.inf
    if tolerance is None:
        model = None if problem is None else problem.model
        solved = Solved(problem, model, solve(model), {})
    elif cells:
        solved = _divided(problem, solve, tolerance, comm, report)
    else:
        solved = _coarsened(problem, described, solve, wishes, comm, report)
    if wishes.estimated and described.discretisation == "voxel":
        distance = partial(_distance_of_voxels, described, solved, solve, comm)
        solved.achieved |= optional(comm, UNTOLD, distance) or {}
    return solved


def solve_accurately(
    described: ProblemOptions,
    accuracy: float,
    solve: Solve,
    wishes: Wishes,
    comm: MPI.Comm = MPI.COMM_WORLD,
    report: Callable[[str, RefinementStep], None] | None = None,
) -> tuple[ProblemOptions, Solved]:
    """The same at the lowest resolution, from that described, that is expected to be accurate.

    Raises
    ------
    UserError
        Also if that would be too large.
    """
    while True:
        solved = solve_solid(described, solve, wishes, comm, report)
        with on_all_ranks():
            if f"{FROM_SOLID}_rms" not in solved.achieved:
                raise UserError(
                    "--accuracy needs a distance from the solid, which could not be told"
                )
            rms, worst = (solved.achieved[f"{FROM_SOLID}_{name}"] for name in ("rms", "worst"))
            excess = max(rms, abs(worst) / WORST) / accuracy
            if excess > 1.0 and described.material not in NAMES:
                raise UserError(
                    f"--accuracy {accuracy:g} needs a higher --resolution than "
                    f"{described.resolution}, and {described.material} is of the voxels of that one"
                )
        if excess <= 1.0:
            # Cells need not be divided as far as without an accuracy.
            solved.achieved.pop("missed_accuracy", None)
            return described, solved
        unknowns = comm.bcast(None if solved.model is None else solved.model.n_dofs)
        factor = float(np.clip(np.sqrt(excess), LEAST_STEP, LARGEST_STEP))
        if unknowns * factor**2 > MOST_UNKNOWNS:
            with on_all_ranks():
                raise UserError(
                    f"--accuracy {accuracy:g} needs more than {MOST_UNKNOWNS:,} unknowns; "
                    f"--resolution {described.resolution} is expected to be {rms:.2g} off, worst "
                    f"{worst:+.2g}"
                )
        solved.modes.destroy()
        described = replace(described, resolution=int(np.ceil(factor * described.resolution)))


def _divided(
    problem: Problem | None,
    solve: Solve,
    tolerance: float,
    comm: MPI.Comm,
    report: Callable[[str, RefinementStep], None] | None,
) -> Solved:
    """Finite cells that are divided where it matters."""

    def cells() -> DividedCells:
        assert problem is not None and problem.covering is not None
        return DividedCells(problem.covering, problem.finite_cells)

    told = None if report is None else partial(report, DIVIDED)
    start: Refinable[Any] | None = compute_on_root(comm, cells)
    model, modes, steps = solve_refined(solve, start, tolerance, comm, told)
    achieved: dict[str, Any] = {}
    if steps:
        achieved = steps[-1].errors.attributes(FROM_SOLID)
        achieved |= {DIVIDED: steps[-1].refined, "refinement_steps": len(steps) - 1}
        if steps[-1].errors.excess(tolerance) > 1.0:
            achieved["missed_accuracy"] = tolerance
    return Solved(problem, model, modes, achieved)


def _coarsened(
    problem: Problem | None,
    described: ProblemOptions,
    solve: Solve,
    wishes: Wishes,
    comm: MPI.Comm,
    report: Callable[[str, RefinementStep], None] | None,
) -> Solved:
    """A coarse model, with those blocks fine that are so in the file to start from, or the fine."""
    assert wishes.refine_to is not None and wishes.options is not None

    def coarse() -> RefinedModel:
        assert problem is not None
        coarsening = described.coarsening()
        assert coarsening is not None
        mesh = None if wishes.start is None else read_modes(wishes.start, with_modes=False).mesh
        return RefinedModel(_fine(problem), coarsening, mesh)

    told = None if report is None else partial(report, FINE)
    refined = compute_on_root(comm, coarse)
    found = solve_coarsened(solve, refined, wishes.refine_to, wishes.options, comm, told)
    achieved = {} if found.errors is None else found.errors.attributes(FROM_FINE)
    achieved |= {"refinement_steps": max(len(found.steps) - 1, 0)}
    if found.reason is not None:
        blocks = comm.bcast(None if refined is None else refined.all_blocks)
        achieved |= {FINE: blocks, FINE_TAKEN: found.reason}
    elif found.errors is not None:
        achieved |= {FINE: found.steps[-1].refined}
    else:
        achieved |= {FINE: comm.bcast(None if refined is None else refined.fine_blocks)}
    return Solved(problem, found.model, found.modes, achieved)


def _fine(problem: Problem) -> ElasticModel:
    coarse = problem.hexahedra
    return fine_model(
        problem.fine,
        problem.young,
        poisson=coarse.poisson,
        density=coarse.density,
        lumped=coarse.lumped,
    )


def _distance_of_voxels(
    described: ProblemOptions, solved: Solved, solve: Solve, comm: MPI.Comm
) -> dict[str, Any]:
    """Distance of voxels from the solid, as attributes."""

    def reference() -> Reference:
        assert solved.problem is not None
        return Reference.of_voxels(described, solved.problem)

    cells = compute_on_root(comm, reference)
    found = solve(None if cells is None else cells.model, LAST)
    modes = found.system.gather(found.vectors)

    def errors() -> ExpectedErrors:
        assert cells is not None and modes is not None
        return cells.errors(solved.modes.values, found.values, modes)

    try:
        return bcast_from_root(comm, errors).attributes(FROM_SOLID)
    finally:
        found.destroy()
