"""Finite cells of which those with the largest errors are divided."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from carillon.fem.finite_cells.build import Covering
from carillon.fem.finite_cells.model import FiniteCellModel
from carillon.fem.model import RIGID_MODES
from solver.accuracy.estimate import CellErrors, estimate_cell_errors
from solver.refinement.estimate import excess
from solver.refinement.refine import RefinementStep

Array = NDArray[np.float64]
Index = NDArray[np.int64]

REMAINING = 0.7
"""Share of the allowed error that cells are divided for."""
MOST_DIVIDED = 0.3
"""Share of the cells up to which dividing some is worth more than a finer lattice."""
MOST_STEPS = 3
"""Times that cells are divided at most."""


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
        """Rate the model by its eigenvalues (k,) and modes (n_dofs, k), and divide cells.

        Returns
        -------
        tuple[RefinementStep, bool]
            What was rated, and whether the model stays as it is: its errors are within `tolerance`,
            or so many cells would have to be divided that a finer lattice is the better way.
        """
        found = estimate_cell_errors(self.model, values, modes)
        worst = int(found.errors.argmax())
        step = RefinementStep(
            self.model.n_dofs,
            len(self._places),
            float(np.sqrt(np.mean(found.errors**2))),
            float(found.errors[worst]),
            RIGID_MODES + 1 + worst,
            RIGID_MODES + len(found.errors),
            found.errors,
        )
        above = excess(found.errors, tolerance)
        if above <= 1.0 or self._steps == MOST_STEPS:
            return step, True
        chosen = self._chosen(found, REMAINING / above)
        if not len(chosen):
            return step, True
        self._divide(chosen)
        return step, False

    def _chosen(self, found: CellErrors, left: float) -> Index:
        """Places (d, 3) of cells to divide so that a share of the error is `left`; none if too many.

        Those that were divided cannot be divided again.
        """
        cells = self.model.cells
        whole = cells.span == cells.span.max()
        gains = np.where(whole, found.shares * (1.0 - 1.0 / found.factors), 0.0)
        order = np.argsort(-gains, kind="stable")
        total = found.shares.sum()
        count = 1 + int(np.searchsorted(np.cumsum(gains[order]), (1.0 - left) * total))
        most = MOST_DIVIDED * len(self._undivided.cells) - len(self._places)
        order = order[: min(count, int(most))]
        step = self._undivided.mesh.edge / cells.mesh.edge
        return np.unique((cells.grid[order[gains[order] > 0.0]] // step).astype(np.int64), axis=0)

    def _divide(self, places: Index) -> None:
        self._places = np.unique(np.concatenate([self._places, places]), axis=0)
        division = self._covering.divided(self._places)
        young = self._undivided.young[division.voxel]
        self.model = replace(self._undivided, cells=division.cells, young=young)
        self._steps += 1
