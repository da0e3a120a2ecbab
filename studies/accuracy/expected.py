"""A solid's frequencies, and the errors that its model expects of them."""

import numpy as np

from carillon.arrays import Array
from carillon.fem.finite_cells.model import FiniteCellModel
from carillon.fem.model import Solid
from carillon.processes.mpi import MPI
from solver.accuracy.estimate import estimate_cell_errors
from solver.accuracy.solving import AccuracyRequest, Solved, solve_solid
from solver.analysis.modal_solver import modal_analysis
from solver.analysis.modes import Modes
from solver.analysis.options import SolverOptions
from solver.analysis.problem import ProblemOptions
from solver.refinement.inverse_iteration import FineStart


def solved_solid(described: ProblemOptions, modes: int, refine_to: float | None) -> Solved:
    """So many modes of a solid with their expected errors, cells divided as `refine_to` asks.

    Raises UserError for anything wrong with the solid, ConvergenceError if a tolerance is missed.
    """

    def solve(
        model: Solid | None, most: int | None = None, start: FineStart | None = None
    ) -> Modes:
        asked = SolverOptions(modes=modes if most is None else min(most, modes))
        return modal_analysis(model, asked, MPI.COMM_SELF)

    request = AccuracyRequest(refine_to=refine_to, estimated=True)
    return solve_solid(described, solve, SolverOptions(modes=modes), request, MPI.COMM_SELF)


def elastic_hertz(solved: Solved, count: int) -> Array:
    """The lowest elastic frequencies (count,) [Hz]."""
    rigid = solved.modes.rigid
    values = solved.modes.values[rigid : rigid + count]
    return np.asarray(np.sqrt(np.maximum(values, 0.0)) / (2.0 * np.pi))


def expected_errors(solved: Solved) -> Array:
    """Relative errors that finite cells expect of their elastic frequencies, the first ones."""
    assert isinstance(solved.model, FiniteCellModel)
    vectors = solved.modes.system.gather(solved.modes.vectors)
    assert vectors is not None
    return estimate_cell_errors(solved.model, solved.modes.values, vectors).errors.errors
