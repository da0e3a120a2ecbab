"""Gauss-Newton steps over all cases, with damping that grows until the errors fall."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from joblib import Parallel, delayed
from numpy.typing import NDArray

from carillon.fem.block import least_patterns
from carillon.serial import serial_blas
from dataset_gen.objectives.calibration import octant_orbits
from dataset_gen.objectives.factored import unit_moduli
from solver.studies.calibration.cases import SpectrumCase, read_case
from solver.studies.calibration.constants import CalibrationConstants, filled_places

logger = logging.getLogger(__name__)

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

LEAST, LARGEST = 0.01, 4.0
"""Bounds of the coarse moduli of a block of one material, relative to it.

Lower ones give soft modes of their own to elements that hold hardly any material.
"""

LARGEST_ERROR = 1.0
"""Logarithmic errors count up to this: a mode that is lost altogether has no derivative."""

PULL = 1e-5
"""Weight of the squared distance from the start; it decides what the spectra leave open."""

LONGEST_STEP = 0.5
SETTLED = 1e-3
"""Relative fall of the cost at which the search ends."""


class Progress(NamedTuple):
    """State after a step: constants, rms of the logarithmic errors, whether the search settled."""

    constants: CalibrationConstants
    rms: float
    settled: bool


class _Sum(NamedTuple):
    cost: float
    gradient: Array
    hessian: Array


@lru_cache(maxsize=1024)
def _case(path: Path) -> SpectrumCase:
    return read_case(path)


@serial_blas
def _contribution(path: Path, vector: Array) -> _Sum:
    """Mean squared error of one case and its Gauss-Newton derivatives."""
    errors, columns = _case(path).linearised(CalibrationConstants(vector))
    errors = np.clip(errors, -LARGEST_ERROR, LARGEST_ERROR)
    count = len(errors)
    return _Sum(
        float(errors @ errors) / count, columns.T @ errors / count, columns.T @ columns / count
    )


def bounds(poisson: float) -> tuple[Array, Array]:
    """Bounds of the vector of constants; the exponents and the lumped share lie in 0..1."""
    numbers, count = octant_orbits()
    low, high = np.zeros(count + 3), np.ones(count + 3)
    for mask in least_patterns():
        unit = np.log(unit_moduli(mask, poisson))
        low[numbers[mask]] = np.minimum(0.0, np.log(LEAST) - unit)
        high[numbers[mask]] = np.maximum(0.0, np.log(LARGEST) - unit)
    return low, high


def calibrate(
    paths: Sequence[Path],
    start: CalibrationConstants,
    poisson: float,
    workers: int = 1,
    steps: int = 8,
    free: Integers | None = None,
    report: Callable[[int, Progress], None] | None = None,
) -> Progress:
    """Minimise the mean squared logarithmic error of all cases' frequencies.

    Parameters
    ----------
    paths
        Files of the cases.
    start
        Constants to begin with and to be pulled towards.
    poisson
        Poisson's ratio of the cases.
    workers
        Processes that share the cases.
    steps
        Largest number of steps.
    free
        Places of the constants to find, all if not given.
    report
        Called after each step with its number.
    """
    low, high = bounds(poisson)
    if free is not None:
        low, high = np.copy(start.vector), np.copy(start.vector)
        low[free], high[free] = (bound[free] for bound in bounds(poisson))
    pool = Parallel(n_jobs=workers, batch_size=1)

    def total(vector: Array) -> _Sum:
        parts = pool(delayed(_contribution)(path, vector) for path in paths)
        distance = vector - start.vector
        return _Sum(
            np.mean([part.cost for part in parts]) + PULL * distance @ distance,
            np.mean([part.gradient for part in parts], axis=0) + PULL * distance,
            np.mean([part.hessian for part in parts], axis=0) + PULL * np.eye(len(vector)),
        )

    vector = np.clip(start.vector, low, high)
    here, damping, settled = total(vector), 1e-4, False
    for number in range(1, steps + 1):
        before = here.cost
        while True:
            trial = np.clip(vector + _step(here, vector, low, high, damping), low, high)
            there = total(trial)
            if there.cost < here.cost or damping > 10.0:
                break
            damping = 10.0 * damping + 1e-3
        if there.cost < here.cost:
            vector, here, damping = trial, there, damping / 5.0
        settled = bool(here.cost > (1.0 - SETTLED) * before)
        state = Progress(CalibrationConstants(vector), float(np.sqrt(here.cost)), settled)
        if report is not None:
            report(number, state)
        if settled:
            break
    return state


def _step(state: _Sum, vector: Array, low: Array, high: Array, damping: float) -> Array:
    """Damped step of the constants that do not press against a bound."""
    down, up = vector <= low, vector >= high
    pressed = (down & (state.gradient > 0.0)) | (up & (state.gradient < 0.0)) | (down & up)
    free = np.flatnonzero(~pressed)
    matrix = state.hessian[np.ix_(free, free)]
    matrix = matrix + damping * np.diag(np.diag(matrix))
    step = np.zeros_like(vector)
    step[free] = -np.linalg.solve(matrix, state.gradient[free])
    return np.clip(step, -LONGEST_STEP, LONGEST_STEP)


def calibrate_in_turn(
    paths: Sequence[Path],
    start: CalibrationConstants,
    poisson: float,
    workers: int = 1,
    steps: int = 8,
    report: Callable[[int, Progress], None] | None = None,
) -> Progress:
    """First the constants of filled blocks, from solids without void cells; then the others.

    All at once, those of filled blocks would make up for what no factor can mend at a surface.
    """
    filled = filled_places()
    solid = [path for path in paths if _case(path).filled.all()]
    if solid:
        first = calibrate(solid, start, poisson, workers, steps, filled, report)
        start = first.constants
    others = np.setdiff1d(np.arange(len(start.vector)), filled)
    return calibrate(paths, start, poisson, workers, steps, others, report)


def rms_by_material(
    paths: Sequence[Path], constants: CalibrationConstants, workers: int
) -> dict[str, float]:
    """Root mean square of the relative frequency errors of the cases of each material."""
    pool = Parallel(n_jobs=workers)
    squares = pool(delayed(_squares)(path, constants.vector) for path in paths)
    materials = sorted({material for material, _ in squares})
    return {
        material: float(np.sqrt(np.mean([s for name, s in squares if name == material])))
        for material in materials
    }


def _squares(path: Path, vector: Array) -> tuple[str, float]:
    case = _case(path)
    errors = np.expm1(case.errors(CalibrationConstants(vector)))
    return case.name.rsplit(":", 1)[1], float(np.mean(errors**2))


def log_step(number: int, state: Progress) -> None:
    """One line about a step."""
    logger.info(f"step {number}: rms error {np.expm1(state.rms):.2%}")
