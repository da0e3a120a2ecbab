"""Which frequencies a solid can have, mode by mode: by itself, and beside its neighbours.

Ordered eigenvalues are continuous functions of the moduli.  So where one material has a mode above
its target, relative to the first mode, and another one below it, a material between the two has it
right: no search is needed to know.  Else descents that look at nothing but this mode say how near
it was brought.  Modes together, each with its two neighbours and as many as may be from the first
one on, take descents in any case, and what these do not find may be there all the same.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carillon.errors import UserError
from sound.clips.targets import Targets
from sound.design.cents import cents
from sound.design.descent import DescentLimits
from sound.design.objective import Objective, Sensitivity
from sound.design.pool import Pool
from sound.design.preparation import DesignProblem, coordinates_of
from sound.design.reduced_model import TrustRegion
from sound.design.tasks import Task, Trial
from sound.project.design import Design
from sound.project.project import Weights

Array = NDArray[np.float64]

HAD_CENTS = 15.0
"""Distance from its target up to which a mode is had [cents]."""
HAD, NOT_ALONE, NOT_BESIDE, NOT_TOGETHER, NOT_SOUGHT = (
    "had",
    "not by itself",
    "not beside its neighbours",
    "not with all others",
    "not sought, the time was over",
)
SAMPLES = 24
"""Materials that are looked at before any descent."""
SPREADS = (0.5, 1.5, 3.0)
"""Root mean square values of their Phi z, in turn."""
DESCENT = TrustRegion(radius=0.3)
STEPS = 6
AT_ONCE = 8
"""Materials after which the time is looked at."""


@dataclass(frozen=True)
class ModeReach:
    """How near to its target a mode can be brought.

    All distances are those of frequencies relative to the first mode.

    Attributes
    ----------
    mode : int
        Counted from 1.
    target_hz : float [Hz]
        Its target.
    cents : float [cents]
        How far above the target it is in the design.
    alone_cents : float [cents]
        The least distance that was found; none where it is known to be had.
    beside_cents : float [cents]
        The same of it and its two neighbours, the largest of the three.
    verdict : str
        What of this it is.
    """

    mode: int
    target_hz: float
    cents: float
    alone_cents: float
    beside_cents: float
    verdict: str


@dataclass(frozen=True)
class Reach:
    """Which modes a solid can have.

    Attributes
    ----------
    modes
        From the second one on.
    together : int
        Modes, counted from the first one, that one of the materials looked at has all of.
    seconds : float [s]
        Time that it took.
    had_cents : float [cents]
        Distance up to which a mode is had.
    """

    modes: list[ModeReach]
    together: int
    seconds: float
    had_cents: float = HAD_CENTS


class SomeModes(Objective):
    """Frequencies of some modes relative to the first one, and nothing else.

    Parameters
    ----------
    targets
        What all modes shall sound at.
    modes
        Numbers of those that count, from 1 on for the second mode.
    """

    def __init__(self, targets: Targets, modes: Sequence[int]) -> None:
        super().__init__(targets, Weights(1.0, 0.0, 0.0))
        self._rows = np.array(modes) - 1

    def frequency_residual(self, eigenvalues: Array) -> Array:
        """Bark differences of the modes that count (Eq. 1)."""
        return np.asarray(super().frequency_residual(eigenvalues)[self._rows])

    def frequency_jacobian(self, eigenvalues: Array, sensitivity: Sensitivity) -> Array:
        """Their derivatives."""
        return np.asarray(super().frequency_jacobian(eigenvalues, sensitivity)[self._rows])


class _Known:
    """Materials whose modes are known.

    Attributes
    ----------
    off : (k, N) [cents]
        How far above their targets modes are, with the first one at its own.
    """

    def __init__(self, wanted: Array) -> None:
        self._wanted = wanted
        self._materials: list[Array] = []
        self.off = np.empty((0, len(wanted)))

    def add(self, trials: Sequence[Trial]) -> None:
        for trial in trials:
            if trial.eigenvalues is not None:
                self._materials.append(trial.z)
                own = np.sqrt(trial.eigenvalues / trial.eigenvalues[0])
                self.off = np.vstack([self.off, cents(own, self._wanted / self._wanted[0])])

    def least(self, modes: Sequence[int]) -> float:
        """Least distance [cents] of some modes; none of one that is on both sides of its target."""
        off = self.off[:, list(modes)]
        if len(modes) == 1 and off.min() <= 0.0 <= off.max():
            return 0.0
        return float(np.abs(off).max(axis=1).min())

    def best(self, modes: Sequence[int], rank: int) -> Array:
        """The material (m,) that is the nearest but `rank` for some modes."""
        order = np.argsort(np.linalg.norm(self.off[:, list(modes)], axis=1), kind="stable")
        return self._materials[order[min(rank, len(order) - 1)]]


def reach(problem: DesignProblem, design: Design, seconds: float | None, descents: int) -> Reach:
    """How near each mode from the second on can be brought to its target, on the fine solid.

    Parameters
    ----------
    problem
        Of the design's project, with the design's targets.
    design
        Whose modes are told about.  Where it has all of them, nothing is sought.
    seconds : float or None [s]
        Time in which descents begin, half of it for modes from the first one on; no limit if None.
    descents : int
        For each question at most, each from another one of the materials that suit it best so far.

    Raises
    ------
    UserError
        See `coordinates_of`; or if a process died, or there are no modes to be had.
    """
    begin = time.monotonic()
    wanted = problem.setting.objective.targets.frequencies
    own = cents(design.frequencies / design.frequencies[0], wanted / wanted[0])
    missed = [mode for mode in range(1, len(wanted)) if abs(own[mode]) > HAD_CENTS]
    if not missed:
        modes = [_judged(mode, own, wanted) for mode in range(1, len(wanted))]
        return Reach(modes, len(wanted), time.monotonic() - begin)
    limit = np.inf if seconds is None else seconds
    with _Descents(problem, descents) as search:
        search.look_at(
            [coordinates_of(problem, design), *_samples(problem.setting.material.dimensions)]
        )
        together = search.together(begin + 0.5 * limit)
        groups = [group for mode in missed for group in ((mode,), _beside(mode, len(wanted)))]
        search.approach(list(dict.fromkeys(groups)), begin + limit)
    modes = [_judged(mode, own, wanted, search) for mode in range(1, len(wanted))]
    return Reach(modes, together, time.monotonic() - begin)


class _Descents:
    """Descents on the fine solid that look at the frequencies of some modes only.

    Attributes
    ----------
    known
        Materials that were looked at.
    sought
        Groups of modes that descents looked for without running out of time.
    """

    def __init__(self, problem: DesignProblem, most: int) -> None:
        setting = problem.setting
        self._targets = setting.objective.targets
        self._most = most
        self._pool = Pool(setting.fine() if setting.is_coarsened else setting, problem.workers)
        self.known = _Known(self._targets.frequencies)
        self.sought: set[tuple[int, ...]] = set()

    def __enter__(self) -> _Descents:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.close()

    def look_at(self, materials: Sequence[Array]) -> None:
        """Find the modes of some materials."""
        self._run([Task(z) for z in materials], np.inf)
        if not len(self.known.off):
            raise UserError(
                "none of the materials that were looked at has modes that could be computed; "
                "expected a solid whose parts hang together, raise resolution"
            )

    def together(self, deadline: float) -> int:
        """How many modes from the first one on one material has."""
        count = len(self._targets.frequencies)
        for last in range(1, count):
            group = tuple(range(1, last + 1))
            if self.known.least(group) > HAD_CENTS:
                tasks = [self._task(group, rank, deadline) for rank in range(self._most)]
                self._run(tasks, deadline)
            if self.known.least(group) > HAD_CENTS:
                return last
        return count

    def approach(self, groups: Sequence[tuple[int, ...]], deadline: float) -> None:
        """Bring groups of modes to their targets, each from the materials that are nearest."""
        for rank in range(self._most):
            groups = [group for group in groups if self.known.least(group) > HAD_CENTS]
            tasks = [self._task(group, rank, deadline) for group in groups]
            self.sought.update(groups[: self._run(tasks, deadline)])

    def _task(self, group: tuple[int, ...], rank: int, deadline: float) -> Task:
        return Task(
            self.known.best(group, rank),
            options=DESCENT,
            steps=STEPS,
            objective=SomeModes(self._targets, group),
            limits=DescentLimits(deadline),
        )

    def _run(self, tasks: Sequence[Task], deadline: float) -> int:
        """Remember what becomes of tasks, a few at once; how many ended in time."""
        found: list[Trial] = []
        in_time = 0
        while len(found) < len(tasks) and time.monotonic() < deadline:
            found += self._pool.run(tasks[len(found) : len(found) + AT_ONCE])
            if time.monotonic() < deadline:
                in_time = len(found)
        self.known.add(found)
        return in_time


def _samples(size: int) -> list[Array]:
    """Coordinates of the uniform material, and of random ones, every other of them smooth."""
    random = np.random.default_rng(0)
    samples = [np.zeros(size)]
    for number in range(1, SAMPLES):
        z = random.standard_normal(size)
        if number % 2:
            z /= np.arange(1, size + 1)
        samples.append(z * SPREADS[number // 2 % len(SPREADS)] / np.linalg.norm(z))
    return samples


def _beside(mode: int, count: int) -> tuple[int, ...]:
    """Numbers of a mode and its neighbours, but for the first mode, which is at its target."""
    return tuple(range(max(1, mode - 1), min(count, mode + 2)))


def _judged(mode: int, own: Array, wanted: Array, search: _Descents | None = None) -> ModeReach:
    alone = beside = 0.0
    verdict = HAD
    if search is not None and abs(own[mode]) > HAD_CENTS:
        neighbours = _beside(mode, len(wanted))
        alone, beside = search.known.least((mode,)), search.known.least(neighbours)
        verdict = NOT_TOGETHER
        if beside > HAD_CENTS:
            verdict = NOT_BESIDE if neighbours in search.sought else NOT_SOUGHT
        if alone > HAD_CENTS:
            verdict = NOT_ALONE if (mode,) in search.sought else NOT_SOUGHT
    return ModeReach(mode + 1, float(wanted[mode]), float(own[mode]), alone, beside, verdict)
