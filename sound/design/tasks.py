"""Tasks of a search and their results, which travel between processes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from carillon.arrays import Array
from carillon.composition.composition import PlacedRegions
from carillon.fem.finite_cells.cells import FiniteCells
from carillon.fem.geometry import HexMesh
from carillon.fem.supports import Supports
from solver.analysis.problem import ProblemOptions
from sound.design.descent import DescentLimits, DesignDescent
from sound.design.local_search import LimitedMemory, StepOptions
from sound.design.material import ReducedMaterial
from sound.design.objective import DesignCost, Objective
from sound.design.reduced_model import TrustRegion
from sound.design.simulation import TOLERANCE, Simulation
from sound.strikes import Strike

FAILED = DesignCost(np.inf, np.inf, np.inf, np.inf)
"""Cost of a material whose modes were not found."""


@dataclass(frozen=True)
class Setting:
    """The solid of a search, its struck points and its objective."""

    mesh: HexMesh
    options: ProblemOptions
    material: ReducedMaterial
    strikes: Sequence[Strike]
    objective: Objective
    cells: FiniteCells | None = None
    placed: PlacedRegions | None = None
    supports: Supports | None = None
    """Regions of the voxels, and what holds the solid, if there are any."""

    @property
    def is_coarsened(self) -> bool:
        """Whether the analysed solid is a coarsening of a finer one."""
        return self.cells is None and self.options.coarsen != "none"

    def fine(self) -> Setting:
        """The setting without coarsening."""
        return replace(self, options=replace(self.options, coarsen="none"))

    def simulation(self, tolerance: float = TOLERANCE, modes: int | None = None) -> Simulation:
        """Simulation of the solid, on all threads; of as many modes as targets if None."""
        modes = modes or len(self.objective.targets.frequencies)
        heard = None if self.objective is None else self.objective.heard
        return Simulation(
            self.mesh,
            self.options,
            self.material,
            self.strikes,
            modes,
            tolerance,
            self.cells,
            self.placed,
            self.supports,
            heard,
        )


@dataclass(frozen=True)
class Task:
    """A material to evaluate, or to descend from.

    Attributes
    ----------
    gradient, fine
        Whether the gradient of the cost is computed, and whether the fine solid is analysed.
    """

    z: Array
    start: Array | None = None
    """(m,), (3 n, k) or None: coordinates, and rows of modes that the analysis starts from."""
    gradient: bool = False
    options: StepOptions | LimitedMemory | TrustRegion | None = None
    steps: int = 0
    damping: tuple[float, ...] | None = None
    limits: DescentLimits = DescentLimits()
    """Parameters of a descent, see `descend`; without options the task is a single evaluation."""
    objective: Objective | None = None
    """Objective instead of the setting's."""
    fine: bool = False


@dataclass(frozen=True)
class Trial:
    """Result of a task.

    Attributes
    ----------
    z, gradient : (m,), (m,) or None
        Coordinates of the material, and the gradient of the cost if it was computed.
    """

    z: Array
    cost: DesignCost
    evaluations: int
    """Cost, `FAILED` if the modes were not found, and number of evaluations."""
    gradient: Array | None = None
    descent: DesignDescent | None = None
    """Record of a descent, without its modes."""
    start: Array | None = None
    """(3 n, k) or None: rows of modes for other analyses to start from, of a descent or with the
    gradient."""
    eigenvalues: Array | None = None
    """(N,) [rad^2/s^2] or None: eigenvalues of the elastic modes, if they were found."""
    seconds: float = 0.0
    """float [s]: processor time of its process since the round of tasks began there."""


@dataclass(frozen=True)
class SearchStep:
    """A step of a descent, reported while the descent goes on: coordinates z (m,), cost by the
    objective of the descent, eigenvalues (N,) [rad^2/s^2] of the elastic modes, whether on the fine
    solid, processor time [s] of its process in the round.
    """

    z: Array
    cost: DesignCost
    eigenvalues: Array
    fine: bool
    seconds: float = 0.0
