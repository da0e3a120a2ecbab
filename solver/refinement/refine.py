"""Models that are refined where it matters until the expected error is small enough."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol, TypeVar

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from carillon.fem.model import Solid
from solver.analysis.modes import Modes
from solver.distribution.collective import bcast_from_root, compute_on_root, optional
from solver.refinement.errors import ExpectedErrors
from solver.refinement.estimate import MODES_USED

Array = NDArray[np.float64]
Model = TypeVar("Model", bound=Solid)
Refined = TypeVar("Refined", bound=Solid, covariant=True)


FINE_BLOCKS, DIVIDED_CELLS = "fine_blocks", "divided_cells"
"""Attributes that count what was refined: blocks that stay fine, and cells that are divided."""


@dataclass(frozen=True)
class RefinementStep:
    """A model that was tried.

    Attributes
    ----------
    unknowns
        Number of unknowns.
    counted, refined
        `FINE_BLOCKS` or `DIVIDED_CELLS`, and how many of these the model has.
    errors
        Expected errors of the frequencies.
    """

    unknowns: int
    counted: str
    refined: int
    errors: ExpectedErrors


class Refinable(Protocol[Refined]):
    """A model that can be refined where it needs to be."""

    @property
    def model(self) -> Refined:
        """The model as it is now."""

    def advance(self, values: Array, modes: Array, tolerance: float) -> tuple[RefinementStep, bool]:
        """Rate the model by its eigenvalues (k,) and modes (n_dofs, k), and refine it.

        Returns
        -------
        tuple[RefinementStep, bool]
            What was rated, and whether the model stays as it is: its errors are within `tolerance`,
            or refining it is not the way to get them there.
        """


def solve_refined(
    solve: Callable[[Model | None], Modes],
    refined: Refinable[Model] | None,
    tolerance: float,
    comm: MPI.Comm = MPI.COMM_WORLD,
    report: Callable[[RefinementStep], None] | None = None,
) -> tuple[Model | None, Modes, list[RefinementStep]]:
    """Solve, estimate and refine until the expected error is at most `tolerance`; collective.

    Of coarse models see `solver.refinement.coarse_or_fine.solve_coarsened`.  An estimate that
    fails, or a refined model that cannot be solved, ends it with a warning: the last modes stand.

    Parameters
    ----------
    solve
        Finds the modes of a model, which is None except on rank 0.
    refined
        On rank 0, which estimates; None on the others.
    tolerance
        For the root mean square of the relative errors of frequencies 7 to 60; the worst may be
        three times as large.
    report
        Called on rank 0 after each step.

    Returns
    -------
    tuple[Model | None, Modes, list[RefinementStep]]
        The last model that was solved, on rank 0; its modes, and the steps that were rated.
    """
    steps: list[RefinementStep] = []
    model = compute_on_root(comm, lambda: None if refined is None else refined.model)
    modes = solve(model)
    while True:
        gathered = modes.system.gather(np.ascontiguousarray(modes.vectors[:, :MODES_USED]))
        rated = optional(
            comm,
            "how far frequencies are off cannot be told",
            partial(bcast_from_root, comm, partial(_advance, refined, modes, gathered, tolerance)),
        )
        if rated is None:
            return model, modes, steps
        step, done = rated
        steps.append(step)
        if report is not None and comm.rank == 0:
            report(step)
        if done:
            return model, modes, steps
        finer = compute_on_root(comm, lambda: None if refined is None else refined.model)
        better = optional(comm, "the model is refined no further", partial(solve, finer))
        if better is None:
            return model, modes, steps
        modes.destroy()
        model, modes = finer, better


def _advance(
    refined: Refinable[Any] | None, modes: Modes, gathered: Array | None, tolerance: float
) -> tuple[RefinementStep, bool]:
    assert refined is not None and gathered is not None
    return refined.advance(modes.values[:MODES_USED], gathered, tolerance)
