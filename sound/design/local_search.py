"""Descents by damped Gauss-Newton steps, and by L-BFGS (scipy), which knows the gradient alone.

The cost is a sum of squares whose Jacobian J is known, so J^T J stands for the Hessian that
quasi-Newton methods have to learn from gradients; it is damped as by Levenberg and Marquardt.
"""

from dataclasses import dataclass

import numpy as np

from carillon.arrays import Array
from sound.design.descent import Descent, DesignDescent

LARGEST_DAMPING = 1e4
"""Greatest damping, over the mean curvature; with more, steps are too short to help."""
HARDER, SOFTER = 8.0, 0.25
"""Factors of the damping after a step that failed, and after one that did as predicted."""
FORETOLD = 0.5
"""Least decrease of the cost, over the predicted one, after which the damping is reduced."""
TINY = 1e-300
LARGE = 1e12
"""Cost of a material without modes."""


@dataclass(frozen=True)
class StepOptions:
    """Options of the Gauss-Newton steps of a descent.

    `parts` are the terms that successive steps reduce in turn: whether E_f, whether E_a.  `damping`
    is the first one, over the mean curvature, and `longest` the greatest root mean square change of
    Phi z in a step.
    """

    parts: tuple[tuple[bool, bool], ...]
    damping: float
    longest: float


def descend(
    descent: Descent,
    z: Array,
    start: Array | None,
    options: StepOptions,
    steps: int,
    damping: tuple[float, ...] | None = None,
) -> DesignDescent:
    """Up to `steps` steps from z, each of which lowers the whole of Eq. (4).

    `Descent.begin` describes z and start; `damping` is the state at the end of a former descent
    with the same options.  Raises ConvergenceError if the first material has no modes.
    """
    count = len(options.parts)
    descent.begin(z, start, damping or (options.damping,) * count)
    record, idle = descent.record, 0
    for step in range(steps):
        taken = _step(descent, options, step % count)
        if descent.is_over:
            break
        idle = 0 if taken else idle + 1
        record.stalled = idle == count
        if record.stalled:
            break
    return record


def _step(descent: Descent, options: StepOptions, part: int) -> bool:
    record, last = descent.record, descent.last
    curvature, gradient = descent.normal_equations(last, *options.parts[part])
    damping = record.damping[part]
    while damping <= LARGEST_DAMPING and curvature.any():
        if descent.is_over:
            return False
        move = _damped(curvature, gradient, damping, options.longest)
        tried = descent.tried(last.z + move, last.modes)
        if tried is None or tried[1].total >= record.cost.total:
            damping *= HARDER
            continue
        evaluation, cost = tried
        predicted = -(gradient @ move + 0.5 * move @ curvature @ move)
        if record.cost.total - cost.total > FORETOLD * predicted:
            damping *= SOFTER
        record.damping = _replaced(record.damping, part, damping)
        descent.come_to(descent.simulation.differentiate(evaluation), cost)
        return True
    record.damping = _replaced(record.damping, part, options.damping)
    return False


def _replaced(values: tuple[float, ...], index: int, value: float) -> tuple[float, ...]:
    return (*values[:index], value, *values[index + 1 :])


def _damped(curvature: Array, gradient: Array, damping: float, longest: float) -> Array:
    size = len(curvature)
    damped = curvature + damping * np.trace(curvature) / size * np.eye(size)
    step = -np.linalg.solve(damped, gradient)
    return np.asarray(step * min(1.0, longest / max(float(np.linalg.norm(step)), TINY)))


@dataclass(frozen=True)
class LimitedMemory:
    """Options of a descent by L-BFGS: so many `evaluations` of gradients stand for one Gauss-Newton
    step.
    """

    evaluations: int


def descend_by_gradients(
    descent: Descent, z: Array, start: Array | None, evaluations: int
) -> DesignDescent:
    """Descend from z with about `evaluations` gradients; `descend` has the other parameters.

    Raises ConvergenceError if the first material has no modes.
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
