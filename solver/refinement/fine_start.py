"""What a coarse model that was not good enough leaves for the analysis of the fine solid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carillon.fem.geometry import Blocks
from carillon.fem.model import RIGID_MODES
from solver.analysis.coarse_start import prolonged
from solver.analysis.modal_solver import ModalSolver
from solver.analysis.options import RANDOM
from solver.analysis.prepared import Prepared
from solver.correction.random_start import Approximation
from solver.correction.shift import is_amid
from solver.files.initial_modes import scatter_rows
from solver.refinement.inverse_iteration import InverseIteration

Array = NDArray[np.float64]


@dataclass
class FineStart:
    """Coarse modes, and the fine solid that they were rated by.

    Attributes
    ----------
    solid
        The fine solid.
    values
        (q,) elastic eigenvalues [rad^2/s^2] of the coarse model.
    blocks, modes
        The coarse mesh, and its modes (coarse n_dofs, q), on rank 0.
    """

    solid: InverseIteration
    values: Array
    blocks: Blocks | None
    modes: Array | None

    @property
    def prepared(self) -> Prepared:
        """Partition and analysis of the fine mesh."""
        return self.solid.prepared

    def begin(self, solver: ModalSolver) -> Approximation | None:
        """What an analysis of the fine solid may start from; None if it has no use for it."""
        requested = solver.options.modes - RIGID_MODES
        if solver.options.method not in RANDOM or solver.options.check_inertia:
            return None
        columns = prolonged(self.blocks, self.modes)
        rows = scatter_rows(columns, len(self.values), solver.local_mesh, solver.comm)
        inverse = self.solid.inverse
        if solver.local_mesh is not self.prepared.local_mesh or inverse is None:
            inverse = None
        elif not self.prepared.linear.indefinite or not is_amid(inverse, requested):
            inverse = None
        else:
            self.solid.inverse = None  # The analysis frees it.
        return Approximation(self.values, rows, inverse)
