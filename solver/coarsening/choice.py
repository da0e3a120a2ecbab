"""The coarsening that a name and its options stand for."""

from __future__ import annotations

from pathlib import Path

from carillon.errors import UserError
from carillon.fem.element import DEFAULT_POISSON
from dataset_gen.objectives import DEFAULT_OBJECTIVE
from solver.coarsening.coarsening import Coarsening
from solver.coarsening.fit import FIT, FitCoarsening
from solver.coarsening.forest import FOREST, load_forest
from solver.coarsening.linear import LINEAR, LinearCoarsening

METHODS = ("none", *LINEAR, FOREST, FIT)


def make_coarsening(
    method: str,
    poisson: float = DEFAULT_POISSON,
    forest: str | Path | None = None,
    objective: str = DEFAULT_OBJECTIVE,
) -> Coarsening | None:
    """The coarsening `method`; None for `none`, the fine mesh itself.

    Parameters
    ----------
    method
        One of `METHODS`.
    poisson
        Poisson's ratio of the solid.
    forest
        File of forests for `ddfem`; the default ones if not given.
    objective
        Fit objective for `fit`.

    Raises
    ------
    UserError
        For an unknown method, or if forests are wanted that are absent or for another Poisson's
        ratio.
    """
    if method == "none":
        return None
    if method in LINEAR:
        return LinearCoarsening(method)
    if method == FOREST:
        return load_forest(forest, poisson)
    if method == FIT:
        return FitCoarsening(objective, poisson)
    raise UserError(f"coarsening {method!r} is unknown, expected one of {', '.join(METHODS)}")
