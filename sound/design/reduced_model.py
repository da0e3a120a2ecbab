"""Descent by steps of a reduced model, whose modes may cross and mix as those of the solid do.

Near a material with modes U the eigenpairs follow from the small matrix diag(lambda) + U^T dK U,
in which dK is linear in the coordinates.  Derivatives of eigenvalues one by one say nothing of two
that are about to cross, which ends the steps of Gauss and Newton between modes that are close; the
small matrix has both.  Steps minimise the cost of the reduced model within a radius, which grows
and shrinks with how well the model foretold [CGT00].
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la
from numpy.typing import NDArray

from carillon.errors import ConvergenceError
from sound.design.descent import CostPoint, DescentLimits, DesignDescent, cost_of, squares_of
from sound.design.objective import Objective, Sensitivity
from sound.design.simulation import Evaluation, Simulation

Array = NDArray[np.float64]

INNER_STEPS = 12
"""Steps on the reduced model, each of which costs a small eigenproblem."""
INNER_DAMPING, HARDEST = 1e-3, 1e4
"""Damping of the first of these, and beyond which they end, as shares of the mean curvature."""
HARDER, SOFTER = 4.0, 0.25
"""Factors of the damping after a step that failed, and after one that did not."""
LITTLE = 1e-3
"""Share of the cost below which a step on the reduced model is the last, and one on the solid is
not worth going on."""
GOOD, POOR = 0.6, 0.25
"""Shares of the foretold fall from which the radius grows, and below which it shrinks."""
WIDER, NARROWER = 1.5, 0.4
"""Factors of a step's length that are the radius then."""
SMALLEST = 1e-4
"""Radius at which a descent has stalled."""


@dataclass(frozen=True)
class TrustRegion:
    """A descent by steps of a reduced model.

    Attributes
    ----------
    radius
        Largest root mean square change of Phi z in the first step.
    """

    radius: float


class ReducedModel:
    """Modes near a material, in the span of its own.

    Parameters
    ----------
    evaluation
        Of the material, with derivatives of all pairs of modes.
    """

    def __init__(self, evaluation: Evaluation) -> None:
        assert evaluation.sensitivity is not None
        self.centre = evaluation
        self._pairs = evaluation.sensitivity.pairs
        self._outside = evaluation.sensitivity.outside
        slopes = evaluation.sensitivity.stiffness
        count = len(evaluation.eigenvalues)
        self._stiffness = np.empty((len(slopes), count, count))
        i, j = self._pairs.T
        self._stiffness[:, i, j] = self._stiffness[:, j, i] = slopes

    def at(self, move: Array) -> Evaluation | None:
        """Eigenpairs after a move (m,) of the coordinates, with derivatives; None if it is too far.

        The modes of the evaluation remain those of the centre.
        """
        centre = self.centre
        matrix = np.diag(centre.eigenvalues) + np.tensordot(move, self._stiffness, 1)
        values, rotation = la.eigh(matrix, check_finite=False)
        if values[0] <= 0.0:
            return None
        pushed = (centre.pushed + np.tensordot(move, self._outside, 1)) @ rotation
        i, j = self._pairs.T
        slopes = (rotation.T @ self._stiffness @ rotation)[:, i, j]
        sensitivity = Sensitivity(self._pairs, slopes, self._outside @ rotation)
        return replace(
            centre,
            z=centre.z + move,
            eigenvalues=values,
            pushed=pushed,
            sensitivity=sensitivity,
        )

    def best_move(
        self, simulation: Simulation, objective: Objective, radius: float
    ) -> tuple[Array, float]:
        """A move (m,) no longer than `radius` to a low cost of the model, and that cost."""
        material, size = simulation.material, len(self.centre.z)
        move, damping = np.zeros(size), INNER_DAMPING
        here = self.at(move)
        assert here is not None
        cost = cost_of(objective, material, here).total
        for _ in range(INNER_STEPS):
            squares = squares_of(objective, material, here)
            curvature, gradient = squares.curvature, squares.gradient
            unit = max(np.trace(curvature) / size, np.finfo(float).tiny) * np.eye(size)
            lower, last = None, cost
            while lower is None and damping <= HARDEST:
                tried = move - np.linalg.solve(curvature + damping * unit, gradient)
                tried *= min(1.0, radius / max(float(np.linalg.norm(tried)), 1e-300))
                there = self.at(tried)
                if there is not None:
                    total = cost_of(objective, material, there).total
                    lower = there if total < cost else None
                if lower is None:
                    damping *= HARDER
            if lower is None:
                break
            here, move, cost = lower, tried, total
            damping *= SOFTER
            if last - cost < LITTLE * last:
                break
        return move, cost


def descend_by_model(
    simulation: Simulation,
    objective: Objective,
    z: Array,
    start: Array | None,
    steps: int,
    radius: float,
    limits: DescentLimits,
) -> DesignDescent:
    """Up to `steps` steps from z, each of which lowers the whole of Eq. (4) or the radius.

    The damping of the result holds the radius to go on with.

    Raises
    ------
    ConvergenceError
        If z itself has no modes.
    """
    evaluation = simulation.evaluate(z, start)
    cost = cost_of(objective, simulation.material, evaluation)
    here = DesignDescent(evaluation, [CostPoint(time.monotonic(), 1, cost)], 1, (radius,))
    for _ in range(steps):
        if limits.reached(here.evaluations):
            break
        assert here.last is not None
        if here.last.sensitivity is None:
            here.last = simulation.differentiate(here.last, whole=True)
            model = ReducedModel(here.last)
        radius = _step(simulation, objective, here, model, radius, limits)
        here.damping = (radius,)
        here.stalled = radius < SMALLEST
        if here.stalled:
            break
    return here


def _step(
    simulation: Simulation,
    objective: Objective,
    here: DesignDescent,
    model: ReducedModel,
    radius: float,
    limits: DescentLimits,
) -> float:
    """Try one step, and take it if it lowers the cost; the radius of the next."""
    before = here.cost.total
    move, foretold = model.best_move(simulation, objective, radius)
    length = float(np.linalg.norm(move))
    if before - foretold <= 1e-6 * before:
        return 0.0
    here.evaluations += 1
    try:
        tried = simulation.evaluate(model.centre.z + move, model.centre.modes)
        cost = cost_of(objective, simulation.material, tried)
    except ConvergenceError:
        return NARROWER * length
    fall = before - cost.total
    if fall > 0.0:
        here.come_to(tried, cost, limits)
    if fall < POOR * (before - foretold):
        return NARROWER * length
    return max(radius, WIDER * length) if fall > GOOD * (before - foretold) else radius
