"""Coarsenings that are linear in the fine moduli."""

from __future__ import annotations

import numpy as np

from forests.baselines import average, galerkin
from solver.coarsening.coarsening import Array, Coarsening

LINEAR = {"average": average, "galerkin": galerkin}
"""Functions that give the moduli of linear coarsenings, by name."""


class LinearCoarsening(Coarsening):
    """The mean of a block's cells, or the Galerkin projection, see `forests.baselines`."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._moduli = LINEAR[name]

    def moduli(self, e: Array) -> Array:
        """See `Coarsening.moduli`."""
        return self._moduli(e)

    def moduli_with_derivatives(self, e: Array) -> tuple[Array, Array]:
        """See `Coarsening.moduli_with_derivatives`; the derivatives are the same everywhere."""
        weights = self._moduli(np.eye(8)).T
        return self.moduli(e), np.broadcast_to(weights, (len(e), 8, 8))
