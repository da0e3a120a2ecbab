"""What a coarse model costs in all, with its check and whatever follows, beside the fine solid."""

import time
from collections.abc import Callable
from operator import itemgetter
from typing import Any, NamedTuple, TypeVar

from carillon.fem.model import ElasticModel
from carillon.processes.mpi import MPI
from solver.analysis.modal_solver import modal_analysis
from solver.analysis.options import SolverOptions
from solver.coarsening.coarsening import Coarsening
from solver.refinement.coarse_or_fine import CoarseOrFine, solve_coarsened
from solver.refinement.model_solver import SolveByOptions
from solver.refinement.refined_model import RefinedModel

T = TypeVar("T")

RUNS = 3
"""Alternating runs by the default method, of which the one with the least processor time counts."""


Cost = dict[str, float]
"""Wall time, `seconds`, and time of all processors, `processor_seconds` [s]."""


class Taken(NamedTuple):
    """What came of a coarse model: the coarse mesh that it ended with, and what was taken."""

    refined: RefinedModel
    found: CoarseOrFine


def take(
    fine: ElasticModel, coarsening: Coarsening, tolerance: float, options: SolverOptions
) -> Taken:
    """A coarse model with its estimate, and what follows from that; on this rank alone.

    Parameters
    ----------
    tolerance
        Expected error that is allowed, see `solve_coarsened`.
    options
        Method and number of modes.
    """
    refined = RefinedModel(fine, coarsening)
    solve = SolveByOptions(options, MPI.COMM_SELF)
    return Taken(refined, solve_coarsened(solve, refined, tolerance, options, MPI.COMM_SELF))


def compare_costs(
    fine: ElasticModel, coarsening: Coarsening, tolerance: float, modes: int, runs: int = RUNS
) -> dict[str, Any]:
    """Times of the fine analysis and of the coarse one by the default method, see `as_values`.

    Meshing and materials, which both need, are not in it. The parameters are those of `take`.
    """
    options = SolverOptions(modes=modes)
    costs: dict[str, list[Cost]] = {"fine": [], "coarse": []}
    for _ in range(runs):
        modes_of_fine, cost = timed(lambda: modal_analysis(fine, options, MPI.COMM_SELF))
        modes_of_fine.destroy()
        costs["fine"].append(cost)
        taken, cost = timed(lambda: take(fine, coarsening, tolerance, options))
        taken.found.modes.destroy()
        costs["coarse"].append(cost)
    least = {name: min(each, key=itemgetter("processor_seconds")) for name, each in costs.items()}
    return as_values(modes, taken, least["fine"], least["coarse"])


def as_values(modes: int, taken: Taken, fine: Cost, coarse: Cost) -> dict[str, Any]:
    """Plain values: which model was `taken` and why, costs, and how many times as fast it was."""
    found = taken.found
    if found.reason is not None:
        kept = "fine"
    else:
        kept = "refined" if found.steps[-1].refined else "coarse"
    return {
        "modes": modes,
        "taken": kept,
        "reason": found.reason,
        "estimates": len(found.steps),
        "fine": fine,
        "coarse": coarse,
        "faster": fine["processor_seconds"] / coarse["processor_seconds"],
    }


def timed(call: Callable[[], T]) -> tuple[T, Cost]:
    """The result of a call and what it cost."""
    wall, processor = time.perf_counter(), time.process_time()
    result = call()
    seconds, spent = time.perf_counter() - wall, time.process_time() - processor
    return result, {"seconds": seconds, "processor_seconds": spent}
