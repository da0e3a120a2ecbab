"""Descent to a local optimum by damped Gauss-Newton steps, or by L-BFGS.

The cost is a sum of squares whose Jacobian J is known, so J^T J stands for the Hessian that other
quasi-Newton methods have to learn from gradients one by one; damped as Levenberg and Marquardt do.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from carillon.errors import ConvergenceError
from sound.design.material import ReducedMaterial
from sound.design.objective import DesignCost, Objective
from sound.design.simulation import Evaluation, Simulation

Array = NDArray[np.float64]

LARGEST_DAMPING = 1e4
"""Damping, as a share of the mean curvature, beyond which steps are too short to help."""
HARDER, SOFTER = 8.0, 0.25
"""Factors of the damping after a step that failed, and after one that did as foretold."""
FORETOLD = 0.5
"""Share of the fall of the quadratic model from which it is trusted more."""
TINY, LARGE = 1e-300, 1e12


@dataclass(frozen=True)
class StepOptions:
    """How the Gauss-Newton steps of a descent go.

    Attributes
    ----------
    parts
        Terms that steps reduce in turn: whether E_f, whether E_a.
    damping
        To begin with, as a share of the mean curvature.
    longest
        Largest root mean square change of Phi z in a step.
    """

    parts: tuple[tuple[bool, bool], ...]
    damping: float
    longest: float


@dataclass(frozen=True)
class LimitedMemory:
    """A descent by L-BFGS, which knows the gradient alone and so moves less at first.

    Attributes
    ----------
    evaluations
        Gradients that stand for one Gauss-Newton step.
    """

    evaluations: int


@dataclass(frozen=True)
class Squares:
    """A cost as 1/2 |r|^2, and the derivatives of r.

    Attributes
    ----------
    residual : (r,)
        Weighted.
    jacobian : (r, m)
        Its derivatives.
    """

    residual: Array
    jacobian: Array

    @property
    def gradient(self) -> Array:
        """J^T r."""
        return np.asarray(self.jacobian.T @ self.residual)

    @property
    def curvature(self) -> Array:
        """J^T J, the Hessian but for the second derivatives of r."""
        return np.asarray(self.jacobian.T @ self.jacobian)


@dataclass(frozen=True)
class DescentLimits:
    """When a descent ends in any case, and who is told how far it is.

    Attributes
    ----------
    deadline : float [s]
        Monotonic clock from which no material is looked at.
    evaluations : float
        Materials that are looked at, at most; that of the start always is.
    tell
        Called with every material that lowers the cost.
    """

    deadline: float = np.inf
    evaluations: float = np.inf
    tell: Callable[[Evaluation, DesignCost], None] | None = None

    def reached(self, evaluations: int) -> bool:
        """Whether one is reached after so many evaluations."""
        return evaluations >= self.evaluations or time.monotonic() >= self.deadline


class CostPoint(NamedTuple):
    """A cost during a descent: when (monotonic clock [s]), after how many evaluations, and what."""

    clock: float
    evaluations: int
    cost: DesignCost


@dataclass
class DesignDescent:
    """How far a descent came.

    Attributes
    ----------
    last
        The last material, with derivatives; none where it stayed in another process.
    costs
        Those from its start on, the one at the end that of `last`.
    evaluations
        Materials looked at.
    damping
        Of each part, to go on with.
    stalled
        Whether no step was to be found any more.
    """

    last: Evaluation | None
    costs: list[CostPoint]
    evaluations: int
    damping: tuple[float, ...]
    stalled: bool = False

    @property
    def cost(self) -> DesignCost:
        """Cost of the last material."""
        return self.costs[-1].cost

    def come_to(self, evaluation: Evaluation, cost: DesignCost, limits: DescentLimits) -> None:
        """Take up a material that lowers the cost."""
        self.last = evaluation
        self.costs.append(CostPoint(time.monotonic(), self.evaluations, cost))
        if limits.tell is not None:
            limits.tell(evaluation, cost)


def cost_of(objective: Objective, material: ReducedMaterial, evaluation: Evaluation) -> DesignCost:
    """Eq. (4) of a material."""
    return objective.cost(
        evaluation.eigenvalues, evaluation.pushed, material.regulariser(evaluation.z)
    )


def squares_of(
    objective: Objective,
    material: ReducedMaterial,
    evaluation: Evaluation,
    frequency: bool = True,
    amplitude: bool = True,
) -> Squares:
    """Weighted residuals of a material with derivatives, those of the regulariser included."""
    weights, sensitivity = objective.weights, evaluation.sensitivity
    assert sensitivity is not None
    root = np.sqrt(weights.regulariser * material.laplacian)
    residuals, rows = [root * evaluation.z], [np.diag(root)]
    if frequency:
        factor = np.sqrt(weights.frequency)
        residuals.append(factor * objective.frequency_residual(evaluation.eigenvalues))
        rows.append(factor * objective.frequency_jacobian(evaluation.eigenvalues, sensitivity))
    if amplitude:
        factor = np.sqrt(weights.amplitude)
        difference = objective.amplitude_residual(evaluation.eigenvalues, evaluation.pushed)
        slopes = objective.amplitude_jacobian(
            evaluation.eigenvalues, evaluation.pushed, sensitivity
        )
        residuals.append(factor * difference.ravel())
        rows.append(factor * slopes.reshape(-1, len(evaluation.z)))
    return Squares(np.concatenate(residuals), np.concatenate(rows))


def descend(
    simulation: Simulation,
    objective: Objective,
    z: Array,
    start: Array | None,
    options: StepOptions,
    steps: int,
    damping: tuple[float, ...] | None = None,
    limits: DescentLimits = DescentLimits(),
) -> DesignDescent:
    """Up to `steps` steps from z, each of which lowers the whole of Eq. (4).

    Parameters
    ----------
    start
        Modes to begin from, see `Simulation.evaluate`.
    damping
        Where a former descent with the same options ended.
    limits
        That end it earlier.

    Raises
    ------
    ConvergenceError
        If z itself has no modes.
    """
    evaluation = simulation.evaluate(z, start, derivatives=True)
    costs = [CostPoint(time.monotonic(), 1, cost_of(objective, simulation.material, evaluation))]
    here = DesignDescent(evaluation, costs, 1, damping or (options.damping,) * len(options.parts))
    idle = 0
    for step in range(steps):
        taken = _step(simulation, objective, here, options, step % len(options.parts), limits)
        if limits.reached(here.evaluations):
            break
        idle = 0 if taken else idle + 1
        here.stalled = idle == len(options.parts)
        if here.stalled:
            break
    return here


def descend_by_gradients(
    simulation: Simulation,
    objective: Objective,
    z: Array,
    start: Array | None,
    evaluations: int,
    limits: DescentLimits = DescentLimits(),
) -> DesignDescent:
    """Descent by L-BFGS (scipy), with about as many gradients as `evaluations` says.

    Parameters and errors are those of `descend`.
    """
    from scipy.optimize import minimize

    evaluation = simulation.evaluate(z, start, derivatives=True)
    costs = [CostPoint(time.monotonic(), 1, cost_of(objective, simulation.material, evaluation))]
    here = DesignDescent(evaluation, costs, 1, ())

    def value(point: Array) -> tuple[float, Array]:
        if limits.reached(here.evaluations):
            raise _LimitError
        here.evaluations += 1
        try:
            assert here.last is not None
            tried = simulation.evaluate(point, here.last.modes, derivatives=True)
        except ConvergenceError:
            return LARGE, np.zeros(len(point))
        cost = cost_of(objective, simulation.material, tried)
        if cost.total < here.cost.total:
            here.come_to(tried, cost, limits)
        return cost.total, squares_of(objective, simulation.material, tried).gradient

    try:
        minimize(value, z, jac=True, method="L-BFGS-B", options={"maxfun": evaluations})
    except _LimitError:
        return here
    here.stalled = len(here.costs) == 1
    return here


class _LimitError(Exception):
    """A limit is reached."""


def _step(
    simulation: Simulation,
    objective: Objective,
    here: DesignDescent,
    options: StepOptions,
    part: int,
    limits: DescentLimits,
) -> bool:
    """Take one step, if there is one that lowers the cost."""
    assert here.last is not None
    squares = squares_of(objective, simulation.material, here.last, *options.parts[part])
    curvature, gradient = squares.curvature, squares.gradient
    damping = here.damping[part]
    while damping <= LARGEST_DAMPING and curvature.any():
        if limits.reached(here.evaluations):
            return False
        move = _damped(curvature, gradient, damping, options.longest)
        here.evaluations += 1
        try:
            tried = simulation.evaluate(here.last.z + move, here.last.modes)
            cost = cost_of(objective, simulation.material, tried)
        except ConvergenceError:
            cost = None
        if cost is None or cost.total >= here.cost.total:
            damping *= HARDER
            continue
        foretold = -(gradient @ move + 0.5 * move @ curvature @ move)
        if here.cost.total - cost.total > FORETOLD * foretold:
            damping *= SOFTER
        here.damping = _replaced(here.damping, part, damping)
        here.come_to(simulation.differentiate(tried), cost, limits)
        return True
    here.damping = _replaced(here.damping, part, options.damping)
    return False


def _replaced(values: tuple[float, ...], index: int, value: float) -> tuple[float, ...]:
    return (*values[:index], value, *values[index + 1 :])


def _damped(curvature: Array, gradient: Array, damping: float, longest: float) -> Array:
    """Step of the damped normal equations, not longer than `longest`."""
    size = len(curvature)
    damped = curvature + damping * np.trace(curvature) / size * np.eye(size)
    step = -np.linalg.solve(damped, gradient)
    return np.asarray(step * min(1.0, longest / max(float(np.linalg.norm(step)), TINY)))
