"""Descent to a local optimum: its cost as a sum of squares, its limits and its record."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from carillon.arrays import Array
from carillon.errors import ConvergenceError
from solver.analysis.modes import Modes
from sound.design.material import ReducedMaterial
from sound.design.objective import DesignCost, Objective
from sound.design.simulation import Evaluation, Simulation


@dataclass(frozen=True)
class DescentLimits:
    """Limits of a descent, and the receiver of its steps.

    No evaluation begins after so many `seconds` of processor time, which count from `begin` [s] of
    this thread on, nor after so many `evaluations`; that of the start is always made.  `tell` is
    called with every material that lowers the cost.
    """

    seconds: float = np.inf
    evaluations: float = np.inf
    tell: Callable[[Evaluation, DesignCost], None] | None = None
    begin: float = 0.0

    @property
    def spent(self) -> float:
        """Processor time [s] of this thread since `begin`."""
        return time.thread_time() - self.begin


class CostPoint(NamedTuple):
    """A cost in a descent, with its processor time [s] and number of evaluations."""

    seconds: float
    evaluations: int
    cost: DesignCost


@dataclass
class DesignDescent:
    """Record of a descent.

    `last` is its last material, None in another process than the descent's; `costs` are those from
    the start on to that one.  With the `damping`, the state of its steps, another descent may go
    on.  It has `stalled` if no further step lowers the cost.
    """

    last: Evaluation | None
    costs: list[CostPoint]
    evaluations: int
    damping: tuple[float, ...] = ()
    stalled: bool = False

    @property
    def cost(self) -> DesignCost:
        """Cost of the last material."""
        return self.costs[-1].cost


class Descent:
    """A descent in progress, within `limits`; its `record` is that so far.

    The simulation and the objective together give the cost.
    """

    record: DesignDescent

    def __init__(
        self,
        simulation: Simulation,
        objective: Objective,
        limits: DescentLimits = DescentLimits(),
    ) -> None:
        self.simulation, self.objective, self.limits = simulation, objective, limits

    def begin(
        self,
        z: Array,
        start: Array | None,
        damping: tuple[float, ...] = (),
        derivatives: bool = True,
    ) -> None:
        """Evaluate the first material (m,), see `Simulation.evaluate`; `damping` is that of the
        record.

        Raises ConvergenceError if it has no modes.
        """
        evaluation = self.simulation.evaluate(z, start, derivatives)
        costs = [CostPoint(self.limits.spent, 1, self.cost_of(evaluation))]
        self.record = DesignDescent(evaluation, costs, 1, damping)

    @property
    def last(self) -> Evaluation:
        """Last material."""
        assert self.record.last is not None
        return self.record.last

    @property
    def is_over(self) -> bool:
        """Whether a limit is reached."""
        limits = self.limits
        return self.record.evaluations >= limits.evaluations or limits.spent >= limits.seconds

    def cost_of(self, evaluation: Evaluation) -> DesignCost:
        """Cost of a material."""
        return cost_of(self.objective, self.simulation.material, evaluation)

    def normal_equations(self, evaluation: Evaluation, *parts: bool) -> tuple[Array, Array]:
        """Curvature and gradient at a material, by the function `normal_equations`."""
        return normal_equations(self.objective, self.simulation.material, evaluation, *parts)

    def tried(
        self, z: Array, start: Modes, derivatives: bool = False
    ) -> tuple[Evaluation, DesignCost] | None:
        """Modes and cost of a material; None if it has no modes."""
        self.record.evaluations += 1
        try:
            evaluation = self.simulation.evaluate(z, start, derivatives)
        except ConvergenceError:
            return None
        return evaluation, self.cost_of(evaluation)

    def come_to(self, evaluation: Evaluation, cost: DesignCost) -> None:
        """Take a material that lowers the cost as the last one."""
        self.record.last = evaluation
        self.record.costs.append(CostPoint(self.limits.spent, self.record.evaluations, cost))
        if self.limits.tell is not None:
            self.limits.tell(evaluation, cost)


def cost_of(objective: Objective, material: ReducedMaterial, evaluation: Evaluation) -> DesignCost:
    """Cost of a material, Eq. (4)."""
    return objective.cost(
        evaluation.eigenvalues, evaluation.pushed, material.regulariser(evaluation.z)
    )


def normal_equations(
    objective: Objective,
    material: ReducedMaterial,
    evaluation: Evaluation,
    frequency: bool = True,
    amplitude: bool = True,
) -> tuple[Array, Array]:
    """Curvature J^T J (m, m) and gradient J^T r (m,) of the cost 1/2 |r|^2 of a material.

    r holds the weighted residuals of the regulariser and, if asked for, of frequencies and
    amplitudes; J its derivatives.
    """
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
    residual, jacobian = np.concatenate(residuals), np.concatenate(rows)
    return np.asarray(jacobian.T @ jacobian), np.asarray(jacobian.T @ residual)
