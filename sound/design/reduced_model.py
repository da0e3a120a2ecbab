"""Descent by steps of a reduced model, whose modes may cross and mix as those of the solid do.

Near a material with modes U the eigenpairs are those of the small matrix diag(lambda) + U^T dK U,
where dK is linear in the coordinates.  Derivatives of single eigenvalues fail near crossings, where
Gauss-Newton steps end; the small matrix describes crossings.  Steps minimise the cost of the
reduced model within a trust region, whose radius depends on the quality of the prediction [CGT00].
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as la

from carillon.arrays import Array
from sound.design.descent import Descent, DesignDescent
from sound.design.sensitivity import Sensitivity
from sound.design.simulation import Evaluation

INNER_STEPS = 12
"""Greatest number of steps on the reduced model, each of which solves a small eigenproblem."""
INNER_DAMPING, HARDEST = 1e-3, 1e4
"""First and greatest damping of these steps, over the mean curvature."""
HARDER, SOFTER = 4.0, 0.25
"""Factors of the damping after a step that failed, and after one that succeeded."""
LITTLE = 1e-3
"""Relative decrease of the cost below which a step on the reduced model is the last one."""
GOOD, POOR = 0.6, 0.25
"""Ratios of actual to predicted decrease above which the radius grows, and below which it
shrinks."""
WIDER, NARROWER = 1.5, 0.4
"""New radius over the length of the step, when the radius grows and when it shrinks."""
SMALLEST = 1e-4
"""Radius below which a descent has stalled."""


@dataclass(frozen=True)
class TrustRegion:
    """Options of a descent by steps of a reduced model: the `radius` is the greatest root mean
    square change of Phi z in the first step.
    """

    radius: float


class ReducedModel:
    """Modes near a material, in the span of its own, from an evaluation with derivatives of all
    pairs.
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

    def best_move(self, descent: Descent, radius: float) -> tuple[Array, float]:
        """A move (m,), at most `radius` long, to a low cost of the model, and that cost."""
        size = len(self.centre.z)
        move, damping = np.zeros(size), INNER_DAMPING
        here = self.at(move)
        assert here is not None
        cost = descent.cost_of(here).total
        for _ in range(INNER_STEPS):
            curvature, gradient = descent.normal_equations(here)
            unit = max(np.trace(curvature) / size, np.finfo(float).tiny) * np.eye(size)
            lower, last = None, cost
            while lower is None and damping <= HARDEST:
                tried = move - np.linalg.solve(curvature + damping * unit, gradient)
                tried *= min(1.0, radius / max(float(np.linalg.norm(tried)), 1e-300))
                there = self.at(tried)
                if there is not None:
                    total = descent.cost_of(there).total
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
    descent: Descent, z: Array, start: Array | None, steps: int, radius: float
) -> DesignDescent:
    """Up to `steps` steps from z, each of which lowers the whole of Eq. (4) or the radius.

    The damping of the result is the radius of the next step.  Raises ConvergenceError if the first
    material has no modes.
    """
    descent.begin(z, start, (radius,), derivatives=False)
    record = descent.record
    for _ in range(steps):
        if descent.is_over:
            break
        if descent.last.sensitivity is None:
            record.last = descent.simulation.differentiate(descent.last, whole=True)
            model = ReducedModel(record.last)
        radius = _step(descent, model, radius)
        record.damping = (radius,)
        record.stalled = radius < SMALLEST
        if record.stalled:
            break
    return record


def _step(descent: Descent, model: ReducedModel, radius: float) -> float:
    before = descent.record.cost.total
    move, predicted = model.best_move(descent, radius)
    length = float(np.linalg.norm(move))
    if before - predicted <= 1e-6 * before:
        return 0.0
    tried = descent.tried(model.centre.z + move, model.centre.modes)
    if tried is None:
        return NARROWER * length
    evaluation, cost = tried
    fall = before - cost.total
    if fall > 0.0:
        descent.come_to(evaluation, cost)
    if fall < POOR * (before - predicted):
        return NARROWER * length
    return max(radius, WIDER * length) if fall > GOOD * (before - predicted) else radius
