"""What a modal analysis finds, and what another may start from."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from carillon.arrays import Array
from solver.assembly.system import System
from solver.correction.random_start import Approximation
from solver.linear import Lasting


@dataclass
class Modes:
    """Result of a modal analysis."""

    values: Array
    """(k,) eigenvalues [rad^2/s^2], ascending."""
    vectors: Array
    """(local, k) mass-normalised modes, this rank's rows of `system`, row-major."""
    residuals: Array
    """(k,) residual ratios, see `solver.verification.residuals.residual_ratios`."""
    system: System
    evidence: dict[str, Any] = field(default_factory=dict)
    """What the solver achieved: orthogonality, error estimate, steps, inertia, rigid modes, ranks,
    peak memory."""
    seconds: dict[str, float] = field(default_factory=dict)
    guard: Array | None = None
    """(local, g) less accurate vectors beyond, which a warm start makes use of; None if there are
    none."""
    inverse: Lasting | None = None
    """Inverse that a warm start makes use of, if there is one."""
    density: Array = field(default_factory=lambda: np.empty(0))
    """(r,) density of each region [kg/m^3], which tells whether a later system has the same
    mass."""

    @property
    def rigid(self) -> int:
        """Number of modes without strain, which are the first ones."""
        return self.system.n_rigid

    @property
    def elastic(self) -> Array:
        """(local, k - r) the modes with strain."""
        return self.vectors[:, self.rigid :]

    def start(self) -> Array:
        """Elastic modes and guard vectors, to start a correction from."""
        blocks = [self.elastic, *([] if self.guard is None else [self.guard])]
        return np.concatenate(blocks, axis=1)

    def destroy(self) -> None:
        """Free what numpy does not; collective."""
        if self.inverse is not None:
            self.inverse.destroy()
        self.system.destroy()


Initial = Modes | Approximation | Array
"""Modes that an analysis may start from."""
