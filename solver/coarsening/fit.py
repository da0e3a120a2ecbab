"""Coarsening by a fit objective that is solved for every block: what forests learn."""

from __future__ import annotations

import numpy as np

from dataset_gen import objectives
from solver.coarsening.coarsening import Array, Coarsening

FIT = "fit"
"""Name of coarsening by fits."""


class FitCoarsening(Coarsening):
    """Minimisers of an objective, which have no derivatives here.

    Parameters
    ----------
    objective
        Name in `dataset_gen.objectives.OBJECTIVES`.
    poisson
        Poisson's ratio of the solid.
    """

    def __init__(self, objective: str, poisson: float) -> None:
        super().__init__(FIT, objectives.lumped_share(objective))
        self.objective = objective
        self.poisson = poisson

    def moduli(self, e: Array) -> Array:
        """See `Coarsening.moduli`."""
        return self.fits(e).moduli

    def fits(self, e: Array) -> objectives.Fits:
        """The same as `dataset_gen.objectives.fit`, but blocks that are equal are fitted once."""
        distinct, row = np.unique(e, axis=0, return_inverse=True)
        fits = objectives.fit(self.objective, distinct, self.poisson)
        return objectives.Fits(*(values[row.ravel()] for values in fits))

    def record(self) -> dict[str, str]:
        """The objective."""
        return {"objective": self.objective}
