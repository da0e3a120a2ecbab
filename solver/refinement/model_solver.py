"""Modes of the models that discretising, refining and rating a solid make."""

from collections.abc import Callable
from dataclasses import replace
from typing import Protocol

from carillon.fem.model import Solid
from carillon.processes.mpi import MPI
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.modes import Initial, Modes
from solver.analysis.options import SolverOptions
from solver.analysis.phases import RankClock
from solver.refinement.inverse_iteration import FineStart

ESTIMATE_TOLERANCE = 1e-7
"""Relative error of the eigenvalues of models for estimates, whose residuals show larger ones."""
INITIAL = "initial modes"
"""Phase that finds what an analysis starts from."""

SolveModel = Callable[..., Modes]
"""Finds the modes of one model after another, as `SolveByOptions` does."""


class Beginning(Protocol):
    """Maker of the modes that an analysis starts from, if it suits the analysis."""

    def suits(self, solver: ModalSolver) -> bool:
        """Whether the analysis starts from such modes."""

    def __call__(self, solver: ModalSolver, model: Solid | None) -> Initial:
        """Modes to start from; collective."""


class SolveByOptions:
    """Finds modes as options say.

    `begin` gives what the analysis of a model starts from, but for models of an estimate. The run
    that they belong to may have a `clock`.
    """

    def __init__(
        self,
        options: SolverOptions,
        comm: MPI.Comm = MPI.COMM_WORLD,
        verbose: bool = False,
        begin: Beginning | None = None,
        clock: RankClock | None = None,
    ) -> None:
        self.options = options
        self._clock = RankClock(comm) if clock is None else clock
        self._comm = comm
        self._verbose = verbose
        self._begin = begin

    def __call__(
        self, model: Solid | None, modes: int | None = None, start: FineStart | None = None
    ) -> Modes:
        """Modes of a model; collective.

        Parameters
        ----------
        model
            The model on rank 0, None on the others.
        modes
            Number of modes if they serve an estimate of errors alone.
        start
            What a coarse model leaves for the analysis of the fine solid.
        """
        options = self.options if modes is None else for_estimate(self.options, modes)
        prepared = None if start is None else start.prepared
        given = self._begin if modes is None and start is None else None
        solver = ModalSolver(
            model,
            options,
            self._comm,
            self._verbose,
            prepared,
            self._clock,
            once=start is None,
            from_coarse=given is not None,
        )
        begin: Initial | None = None
        if start is not None:
            with self._clock(INITIAL):
                begin = start.begin(solver)
        elif given is not None and given.suits(solver):
            with self._clock(INITIAL):
                begin = given(solver, model)
        result = solver.solve(initial_modes=begin)
        result.seconds = {**solver.seconds, **result.seconds}
        return result


def for_estimate(options: SolverOptions, modes: int) -> SolverOptions:
    """The options with few modes at most, no more accurate than an estimate of errors needs."""
    fewer = replace(options, modes=min(modes, options.modes))
    if options.is_general or options.tolerance == 0.0:
        return fewer
    # The method is left to `auto`, and incomplete factors are none for cells cut by a surface.
    incomplete = options.linear_solver == "icc-pcg"
    return SolverOptions(
        method="auto",
        modes=fewer.modes,
        tolerance=max(options.tolerance or 0.0, ESTIMATE_TOLERANCE),
        seed=options.seed,
        linear_solver="auto" if incomplete else options.linear_solver,
    )
