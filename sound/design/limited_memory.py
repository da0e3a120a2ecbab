"""Descent by L-BFGS (scipy), which knows the gradient alone and so moves less at first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array
from sound.design.descent import Descent, DesignDescent

LARGE = 1e12
"""Cost of a material without modes."""


@dataclass(frozen=True)
class LimitedMemory:
    """Options of a descent by L-BFGS.

    Attributes
    ----------
    evaluations
        Number of gradients that stand for one Gauss-Newton step.
    """

    evaluations: int


def descend_by_gradients(
    descent: Descent, z: Array, start: Array | None, evaluations: int
) -> DesignDescent:
    """Descend from z with about `evaluations` gradients; `descend` has the other parameters.

    Raises
    ------
    ConvergenceError
        If the first material has no modes.
    """
    from scipy.optimize import minimize

    descent.begin(z, start)
    record = descent.record

    def value(point: Array) -> tuple[float, Array]:
        if descent.is_over:
            raise _LimitError
        tried = descent.tried(point, descent.last.modes, derivatives=True)
        if tried is None:
            return LARGE, np.zeros(len(point))
        evaluation, cost = tried
        if cost.total < record.cost.total:
            descent.come_to(evaluation, cost)
        return cost.total, descent.normal_equations(evaluation)[1]

    try:
        minimize(value, z, jac=True, method="L-BFGS-B", options={"maxfun": evaluations})
    except _LimitError:
        return record
    record.stalled = len(record.costs) == 1
    return record


class _LimitError(Exception):
    """A limit is reached."""
