"""Finite cells of which those with the largest errors are divided."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from carillon.command_line.progress import say
from carillon.errors import UserError
from carillon.fem.finite_cells.covering import Covering
from carillon.fem.finite_cells.model import FiniteCellModel
from solver.accuracy.estimate import CellErrors, estimate_cell_errors
from solver.refinement.refine import DIVIDED_CELLS, RefinementStep

Array = NDArray[np.float64]
Index = NDArray[np.int64]

REMAINING = 0.7
"""Share of the allowed error at which the division of cells aims."""
MOST_DIVIDED = 0.15
"""Largest share of the cells that is divided. Beyond it a finer lattice is worth more."""
MOST_STEPS = 3
"""Largest number of rounds in which cells are divided."""


class DividedCells:
    """A solid of finite cells and which of them are divided.

    Parameters
    ----------
    covering
        The undivided cells.
    model
        Their material.
    """

    def __init__(self, covering: Covering, model: FiniteCellModel) -> None:
        self.model, self._undivided, self._covering = model, model, covering
        self._places: Index = np.empty((0, 3), dtype=np.int64)
        self._steps = 0

    def advance(self, values: Array, modes: Array, tolerance: float) -> tuple[RefinementStep, bool]:
        """See `Refinable.advance`; cells are divided unless too many of them would have to be."""
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
        young = self._undivided.young[division.voxel]
        self.model = replace(self._undivided, cells=division.cells, young=young)
        self._steps += 1
        return True
