"""Finite cells of which those with the largest errors are divided."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from mpi4py import MPI

from carillon.arrays import Array, Index
from carillon.command_line.progress import say
from carillon.composition.composition import PlacedRegions
from carillon.errors import UserError
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.finite_cells.covering import Covering
from carillon.fem.finite_cells.model import FiniteCellModel
from solver.accuracy.estimate import CellErrors, estimate_cell_errors
from solver.analysis.modes import Modes
from solver.distribution.collective import bcast_from_root, compute_on_root, optional
from solver.refinement.errors import DIVIDED_CELLS, RefinementStep
from solver.refinement.estimate import MODES_USED

REMAINING = 0.7
"""Share of the allowed error at which the division of cells aims."""
MOST_DIVIDED = 0.15
"""Largest share of the cells that is divided. Beyond it a finer lattice is worth more."""
MOST_STEPS = 3
"""Largest number of rounds in which cells are divided."""


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
        self._places: Index = np.empty((0, 3), dtype=np.int64)
        self._steps = 0

    def advance(self, values: Array, modes: Array, tolerance: float) -> tuple[RefinementStep, bool]:
        """Rate the cells by eigenvalues (k,) and modes (n_dofs, k), and divide some of them.

        Also returns whether the cells stay as they are: their errors are within `tolerance`, or too
        many of them would have to be divided.
        """
        estimate = estimate_cell_errors(self.model, values, modes)
        step = RefinementStep(self.model.n_dofs, DIVIDED_CELLS, len(self._places), estimate.errors)
        above = estimate.errors.excess(tolerance)
        if above <= 1.0 or self._steps == MOST_STEPS:
            return step, True
        chosen = self._chosen(estimate, REMAINING / above)
        return step, not (len(chosen) and self._divide(chosen))

    def _chosen(self, estimate: CellErrors, left: float) -> Index:
        """Places (d, 3) of cells to divide so that of the error a share is `left`, or of the worst.

        Those that were divided cannot be divided again.
        """
        cells = self.model.cells
        whole = cells.span == cells.span.max()
        gains = np.where(whole, estimate.shares * (1.0 - 1.0 / estimate.factors), 0.0)
        order = np.argsort(-gains, kind="stable")
        total = estimate.shares.sum()
        count = 1 + int(np.searchsorted(np.cumsum(gains[order]), (1.0 - left) * total))
        most = MOST_DIVIDED * len(self._undivided.cells) - len(self._places)
        order = order[: min(count, int(most))]
        step = self._undivided.mesh.edge / cells.mesh.edge
        return np.unique((cells.grid[order[gains[order] > 0.0]] // step).astype(np.int64), axis=0)

    def _divide(self, places: Index) -> bool:
        """Divide the cells at more places (d, 3), and whether that was possible."""
        together = np.unique(np.concatenate([self._places, places]), axis=0)
        try:
            division = self._covering.divided(together)
        except UserError as error:
            say(f"no more cells are divided: {error}")
            return False
        self._places = together
        factor = self._undivided.young
        whole = self._undivided
        if whole.region is not None:
            factor = factor / whole.regions.young[whole.region]
        placed = self._placed_on(division.cells)
        young = factor[division.voxel]
        if placed.region is not None:
            young = placed.regions.moduli(placed.region, young)
        self.model = replace(
            whole,
            cells=division.cells,
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
