"""What a search asks to be evaluated, and what becomes of it; it travels between processes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.geometry import HexMesh
from solver.analysis.problem import ProblemOptions
from sound.design.descent import DescentLimits, DesignDescent, LimitedMemory, StepOptions
from sound.design.material import ReducedMaterial
from sound.design.objective import DesignCost, Objective
from sound.design.reduced_model import TrustRegion
from sound.design.simulation import TOLERANCE, Simulation
from sound.strikes import Strike

Array = NDArray[np.float64]

FAILED = DesignCost(np.inf, np.inf, np.inf, np.inf)
"""Cost of a material whose modes could not be found."""


@dataclass(frozen=True)
class Setting:
    """The solid, its struck points and what they shall sound like; travels to other processes."""

    mesh: HexMesh
    options: ProblemOptions
    material: ReducedMaterial
    strikes: Sequence[Strike]
    objective: Objective
    cells: FiniteCells | None = None

    @property
    def is_coarsened(self) -> bool:
        """Whether what is analysed stands for a finer solid."""
        return self.cells is None and self.options.coarsen != "none"

    def fine(self) -> Setting:
        """The same without coarsening."""
        return replace(self, options=replace(self.options, coarsen="none"))

    def simulation(self, tolerance: float = TOLERANCE) -> Simulation:
        """Its simulation, on as many threads as this process is allowed."""
        modes = len(self.objective.targets.frequencies)
        return Simulation(
            self.mesh, self.options, self.material, self.strikes, modes, tolerance, self.cells
        )


@dataclass(frozen=True)
class Task:
    """A material to evaluate, or to descend from.

    Attributes
    ----------
    z : (m,)
        Coordinates.
    start : (3 n, k) or None
        Rows of modes to begin from.
    gradient : bool
        Whether the gradient of the cost is asked for.
    options, steps, damping, limits
        Of a descent, see `descend`; an evaluation alone if there are no options.
    objective
        What is lowered in place of the setting's.
    fine : bool
        Whether the fine solid is meant, not the one of the search.
    """

    z: Array
    start: Array | None = None
    gradient: bool = False
    options: StepOptions | LimitedMemory | TrustRegion | None = None
    steps: int = 0
    damping: tuple[float, ...] | None = None
    limits: DescentLimits = DescentLimits()
    objective: Objective | None = None
    fine: bool = False


@dataclass(frozen=True)
class Trial:
    """What became of a task.

    Attributes
    ----------
    z : (m,)
        Coordinates of the material.
    cost
        Its cost, `FAILED` if there are no modes to be had.
    evaluations : int
        Materials looked at.
    gradient : (m,) or None
        Of the cost, if it was asked for.
    descent
        How a descent went; its modes stay behind.
    start : (3 n, k) or None
        Modes for others to begin from, of a descent or with the gradient.
    eigenvalues : (N,) [rad^2/s^2] or None
        Of the elastic modes, if there are any to be had.
    """

    z: Array
    cost: DesignCost
    evaluations: int
    gradient: Array | None = None
    descent: DesignDescent | None = None
    start: Array | None = None
    eigenvalues: Array | None = None


@dataclass(frozen=True)
class SearchStep:
    """A material that a descent has come to, told while it goes on.

    Attributes
    ----------
    z : (m,)
        Coordinates.
    cost
        By what the descent lowers.
    eigenvalues : (N,) [rad^2/s^2]
        Of the elastic modes.
    fine : bool
        Whether the fine solid was looked at.
    """

    z: Array
    cost: DesignCost
    eigenvalues: Array
    fine: bool
