"""Descent by damped Gauss-Newton steps.

The cost is a sum of squares whose Jacobian J is known, so J^T J stands for the Hessian that
quasi-Newton methods have to learn from gradients; it is damped as by Levenberg and Marquardt.
"""

from __future__ import annotations

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


@dataclass(frozen=True)
class StepOptions:
    """Options of the Gauss-Newton steps of a descent.

    Attributes
    ----------
    parts
        Terms that successive steps reduce in turn: whether E_f, whether E_a.
    damping
        First damping, over the mean curvature.
    longest
        Greatest root mean square change of Phi z in a step.
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

    Parameters
    ----------
    descent
        Solid, objective and limits.
    z, start
        First material, see `Descent.begin`.
    options, steps
        Options of the steps, and their greatest number.
    damping
        State at the end of a former descent with the same options.

    Raises
    ------
    ConvergenceError
        If the first material has no modes.
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
    """Take a step that lowers the cost, if there is one."""
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
    """Step of the damped normal equations, not longer than `longest`."""
    size = len(curvature)
    damped = curvature + damping * np.trace(curvature) / size * np.eye(size)
    step = -np.linalg.solve(damped, gradient)
    return np.asarray(step * min(1.0, longest / max(float(np.linalg.norm(step)), TINY)))
