"""The coarsening that a name and its options stand for."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError
from carillon.fem.element import DEFAULT_POISSON
from dataset_gen import objectives
from dataset_gen.objectives import DEFAULT_OBJECTIVE
from forests.baselines import average, galerkin
from solver.coarsening.anisotropic import general_objective
from solver.coarsening.coarsening import Coarsening
from solver.coarsening.forest import FOREST, load_forest

LINEAR = {"average": average, "galerkin": galerkin}
"""Functions that give the moduli of linear coarsenings, by name."""
FIT = "fit"
"""Name of coarsening by fits."""
METHODS = ("none", *LINEAR, FOREST, FIT)


def make_coarsening(
    method: str,
    poisson: float | Sequence[float] = DEFAULT_POISSON,
    forest: str | Path | None = None,
    objective: str = DEFAULT_OBJECTIVE,
) -> Coarsening | None:
    """The coarsening `method`; None for `none`, the fine mesh itself.

    The `forest` file is for `ddfem`; the default one if not given. Raises UserError for an unknown
    method, or if forests are wanted that are absent or for another Poisson's ratio.
    """
    if method == "none":
        return None
    if method in LINEAR:
        return LinearCoarsening(method)
    ratios = (poisson,) if isinstance(poisson, float | int) else tuple(poisson)
    if method == FOREST:
        return load_forest(forest, *ratios)
    if method == FIT:
        mean = sum(ratios) / len(ratios) if ratios else DEFAULT_POISSON
        return FitCoarsening(objective, mean)
    raise UserError(f"coarsening {method!r} is unknown, expected one of {', '.join(METHODS)}")


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


class FitCoarsening(Coarsening):
    """Minimisers of an objective, which have no derivatives here."""

    def __init__(self, objective: str, poisson: float) -> None:
        super().__init__(FIT, objectives.lumped_share(objective), general_objective(objective))
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
