"""Finite cells of which those with the largest errors are divided, again and again."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from carillon.arrays import Array, Index
from carillon.command_line.progress import say
from carillon.composition.composition import PlacedRegions
from carillon.errors import UserError
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.covering import MOST_LEVELS, Covering, balanced
from carillon.fem.finite_cells.model import FiniteCellModel
from carillon.processes.mpi import MPI
from solver.accuracy.estimate import HALVED, CellErrors, estimate_cell_errors
from solver.analysis.modes import Modes
from solver.distribution.collective import bcast_from_root, compute_on_root, optional
from solver.refinement.errors import DIVIDED_CELLS, ExpectedErrors, RefinementStep
from solver.refinement.estimate import MODES_USED

REMAINING = 0.7
"""Share of the allowed error at which the division of cells aims."""
LEAST, MOST = 0.5, 0.9
"""Bounds of the share of the error whose cells one round divides: fewer gain little for another
solution, of more a later round knows more."""
LARGEST, MOST_GROWTH = 60_000, 2.0
"""Unknowns beyond which no cells are divided, or, of models with many, how many times as many as
without; a finer lattice is worth more then."""
OF_DIVISION = 150
"""About the number of unknowns that a cell adds where it is divided."""
MOST_STEPS = 5
"""Largest number of rounds in which cells are divided."""
MOST_RAISED = 2.0
"""Largest factor by which expected errors are raised where divisions gained more than expected."""


class DividedCells:
    """A solid of finite cells and which of them are divided."""

    def __init__(
        self,
        covering: Covering,
        model: FiniteCellModel,
        placed_on: Callable[[FiniteCells], PlacedRegions] | None = None,
    ) -> None:
        self.model, self._undivided, self._covering = model, model, covering
        alike = PlacedRegions(model.regions)
        self._placed_on = placed_on or (lambda cells: alike)
        self._divisions: list[Index] = [np.empty((0, 3), dtype=np.int64)] * MOST_LEVELS
        self._steps = 0
        self._before: tuple[Array, Array] | None = None

    @property
    def count(self) -> int:
        """Number of cells that are divided."""
        return sum(len(places) for places in self._divisions)

    def advance(self, values: Array, modes: Array, tolerance: float) -> tuple[RefinementStep, bool]:
        """Rate the cells by eigenvalues (k,) and modes (n_dofs, k), and divide some of them.

        Also returns whether the cells stay as they are: their errors are within `tolerance`, or too
        many of them would have to be divided.
        """
        estimate = estimate_cell_errors(self.model, values, modes)
        errors = self._raised(values, estimate.errors)
        step = RefinementStep(self.model.n_dofs, DIVIDED_CELLS, self.count, errors)
        above = errors.excess(tolerance)
        if above <= 1.0 or self._steps == MOST_STEPS:
            return step, True
        chosen = self._chosen(estimate, REMAINING / above)
        return step, not (len(chosen) and self._divide(chosen))

    def _raised(self, values: Array, expected: ExpectedErrors) -> ExpectedErrors:
        """Expected errors, raised as far as the last division gained more than was expected of it.

        Where walls meet at sharp edges that is up to twice as much.
        """
        errors, before = expected.errors, self._before
        elastic = values[expected.rigid :][: len(errors)]
        self._before = elastic, errors
        if before is None or len(before[0]) != len(elastic):
            return expected
        fallen = np.sqrt(np.maximum(before[0] / elastic, 0.0)) - 1.0
        foretold = (1.0 + before[1]) / (1.0 + errors) - 1.0
        ratio = float(np.linalg.norm(fallen) / np.linalg.norm(foretold))
        return replace(expected, errors=np.clip(ratio, 1.0, MOST_RAISED) * errors)

    def _chosen(self, estimate: CellErrors, left: float) -> Index:
        """Cells (d,) to divide so that of the error a share is `left`, or of the worst."""
        cells = self.model.cells
        gains = np.where(cells.levels == MOST_LEVELS, 0.0, estimate.shares)
        order = np.argsort(-gains, kind="stable")
        part = np.clip((1.0 - left) / (1.0 - 1.0 / HALVED), LEAST, MOST)
        count = 1 + int(np.searchsorted(np.cumsum(gains[order]), part * estimate.shares.sum()))
        room = self._most_unknowns - self.model.n_dofs
        order = order[: min(count, max(int(room / OF_DIVISION), 0))]
        return np.asarray(order[gains[order] > 0.0])

    @property
    def _most_unknowns(self) -> float:
        return max(LARGEST, MOST_GROWTH * self._undivided.n_dofs)

    def _divisions_with(self, chosen: Index) -> list[Index]:
        """Cells of every level that are divided if those `chosen` (d,) of today's are, too."""
        cells = self.model.cells
        levels, places = cells.levels[chosen], cells.corner[chosen] // cells.span[chosen, None]
        both = [
            np.concatenate([already, places[levels == level]])
            for level, already in enumerate(self._divisions)
        ]
        distinct = [np.unique(each.astype(np.int64), axis=0) for each in both]
        return balanced(distinct, self._covering.shape)

    def _divide(self, chosen: Index) -> bool:
        """Divide more cells (d,), those with the largest errors first, and whether there was room.

        Others are divided with them, since no neighbour is more than twice as large.
        """
        while len(chosen):
            divisions = self._divisions_with(chosen)
            try:
                divided = self._covering.divided(divisions)
            except UserError as error:
                say(f"no more cells are divided: {error}")
                return False
            if 3 * divided.n_nodes <= self._most_unknowns:
                break
            chosen = chosen[: len(chosen) // 2]
        else:
            return False
        self._divisions = divisions
        placed = self._placed_on(divided)
        whole, young = self._undivided, self._undivided.young
        if placed.region is not None:
            factor = young
            if whole.region is not None:
                factor = young / whole.regions.young[whole.region]
            young = placed.regions.moduli(placed.region, factor)
        self.model = replace(
            whole,
            cells=divided,
            young=young,
            regions=placed.regions,
            region=placed.region,
            shared=placed.shared,
        )
        self._steps += 1
        return True


def solve_refined(
    solve: Callable[[FiniteCellModel | None], Modes],
    cells: DividedCells | None,
    tolerance: float,
    comm: MPI.Comm = MPI.COMM_WORLD,
    report: Callable[[RefinementStep], None] | None = None,
) -> tuple[FiniteCellModel | None, Modes, list[RefinementStep]]:
    """Solve, estimate and divide until the expected error is at most `tolerance`; collective.

    An estimate that fails, or a model that cannot be solved, ends it with a warning: the last modes
    stand. The tolerance is that of the root mean square of the relative errors of frequencies 7 to
    60; the worst may be three times as large. Returns the last model that was solved, on rank 0;
    its modes, and the steps that were rated.
    """
    steps: list[RefinementStep] = []
    model = compute_on_root(comm, lambda: None if cells is None else cells.model)
    modes = solve(model)
    while True:
        gathered = modes.system.gather(np.ascontiguousarray(modes.vectors[:, :MODES_USED]))
        rated = optional(
            comm,
            "how far frequencies are off cannot be told",
            partial(bcast_from_root, comm, partial(_advance, cells, modes, gathered, tolerance)),
        )
        if rated is None:
            return model, modes, steps
        step, done = rated
        steps.append(step)
        if report is not None and comm.rank == 0:
            report(step)
        if done:
            return model, modes, steps
        finer = compute_on_root(comm, lambda: None if cells is None else cells.model)
        better = optional(comm, "the model is refined no further", partial(solve, finer))
        if better is None:
            return model, modes, steps
        modes.destroy()
        model, modes = finer, better


def _advance(
    cells: DividedCells | None, modes: Modes, gathered: Array | None, tolerance: float
) -> tuple[RefinementStep, bool]:
    assert cells is not None and gathered is not None
    return cells.advance(modes.values[:MODES_USED], gathered, tolerance)
