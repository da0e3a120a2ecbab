"""Reach of a solid: which target frequencies it can have, mode by mode and with neighbours.

Ordered eigenvalues are continuous functions of the moduli.  So if one material has a mode above its
target, relative to the first mode, and another one below, a material between them meets the target:
no search is needed.  Otherwise descents that lower the distance of this mode alone show how near it
gets.  Several modes together, each with its two neighbours or all from the first one on, always
need descents, and a material that these do not find may still exist.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from carillon.arrays import Array
from carillon.errors import UserError
from solver.files.modes_file import frequencies
from sound.clips.targets import Targets
from sound.design.descent import DescentLimits
from sound.design.objective import Objective
from sound.design.pitch import cents
from sound.design.pool import Pool
from sound.design.preparation import DesignProblem, coordinates_of
from sound.design.reduced_model import TrustRegion
from sound.design.sensitivity import Sensitivity
from sound.design.tasks import Task, Trial
from sound.project.design import Design
from sound.project.settings import Weights

HAD_CENTS = 15.0
"""Greatest distance of a mode from its target that counts as met [cents]."""
HAD, NOT_ALONE, NOT_BESIDE, NOT_TOGETHER, NOT_SOUGHT = (
    "had",
    "not by itself",
    "not beside its neighbours",
    "not with all others",
    "not sought, the time was over",
)
"""Verdicts on a mode."""
SAMPLES = 24
"""Number of materials that are analysed before the descents."""
SPREADS = (0.5, 1.5, 3.0)
"""Root mean square values of Phi z of these materials, in turn."""
DESCENT = TrustRegion(radius=0.3)
STEPS = 6
"""Number of steps of a descent."""
AT_ONCE = 8
"""Number of tasks between two looks at the time."""


@dataclass(frozen=True)
class ModeReach:
    """How near the mode of a number from 1 on gets to its target [Hz], relative to the first mode.

    The design is `cents` above the target.  `alone_cents` is the least distance found, 0 if the
    target can be met, `beside_cents` that of the mode and its two neighbours together, the largest
    of the three.
    """

    mode: int
    target_hz: float
    cents: float
    alone_cents: float
    beside_cents: float
    verdict: str


@dataclass(frozen=True)
class Reach:
    """Reach of a solid, mode by mode from the second one on.

    One material meets the targets of the first so many modes `together`.  Distances up to
    `had_cents` count as met; the search took so many `seconds` of processor time.
    """

    modes: list[ModeReach]
    together: int
    seconds: float
    had_cents: float = HAD_CENTS


class SomeModes(Objective):
    """Objective of the frequencies of some modes, 1 being the second one."""

    def __init__(self, targets: Targets, modes: Sequence[int], absolute: bool = False) -> None:
        super().__init__(targets, Weights(1.0, 0.0, 0.0), None, absolute)
        self._rows = np.searchsorted(self.compared, modes)

    def frequency_residual(self, eigenvalues: Array) -> Array:
        """Bark differences of the modes that count (Eq. 1)."""
        return np.asarray(super().frequency_residual(eigenvalues)[self._rows])

    def frequency_jacobian(self, eigenvalues: Array, sensitivity: Sensitivity) -> Array:
        """Their derivatives."""
        return np.asarray(super().frequency_jacobian(eigenvalues, sensitivity)[self._rows])


class _Known:
    """Materials whose modes are known, with distances `off` (k, N) [cents] of these above their
    targets, the first mode being at its target unless they are `absolute`.
    """

    def __init__(self, targets: Targets, absolute: bool) -> None:
        self._targets, self._absolute = targets, absolute
        self._materials: list[Array] = []
        self.off = np.empty((0, len(targets.frequencies)))

    def add(self, trials: Sequence[Trial]) -> None:
        for trial in trials:
            if trial.eigenvalues is not None:
                self._materials.append(trial.z)
                own = distances(frequencies(trial.eigenvalues), self._targets, self._absolute)
                self.off = np.vstack([self.off, own])

    def least(self, modes: Sequence[int]) -> float:
        """Least distance [cents] of some modes; 0 of a single one with materials on both sides."""
        off = self.off[:, list(modes)]
        if len(modes) == 1 and off.min() <= 0.0 <= off.max():
            return 0.0
        return float(np.abs(off).max(axis=1).min())

    def best(self, modes: Sequence[int], rank: int) -> Array:
        """The material (m,) of rank `rank`, 0 being the nearest, for some modes."""
        order = np.argsort(np.linalg.norm(self.off[:, list(modes)], axis=1), kind="stable")
        return self._materials[order[min(rank, len(order) - 1)]]


def reach(problem: DesignProblem, design: Design, seconds: float | None, descents: int) -> Reach:
    """Reach of each mode from the second one on, on the fine solid.

    The problem is that of the design's project, with the design's targets; if it meets them all,
    there is no search.  Descents begin within so many seconds of processor time, half of it for
    modes from the first one on, without a limit if None.  Each question has so many descents at
    most, each from another one of the best materials.  Raises UserError as `coordinates_of` does,
    or if a process died, or there are no modes to be had.
    """
    objective = problem.setting.objective
    targets, compared = objective.targets.frequencies, objective.compared.tolist()
    own = distances(design.frequencies, objective.targets, objective.absolute)
    missed = [mode for mode in compared if abs(own[mode]) > HAD_CENTS]
    if not missed:
        modes = [_judged(mode, own, targets, compared) for mode in compared]
        return Reach(modes, len(objective.targets.sounding), 0.0)
    limit = np.inf if seconds is None else seconds
    with _Descents(problem, descents) as search:
        search.look_at(
            [coordinates_of(problem, design), *_samples(problem.setting.material.dimensions)]
        )
        together = search.together(0.5 * limit)
        groups = [group for mode in missed for group in ((mode,), _beside(mode, compared))]
        search.approach(list(dict.fromkeys(groups)), limit)
        seconds = search.seconds
    modes = [_judged(mode, own, targets, compared, search) for mode in compared]
    return Reach(modes, together, seconds)


def distances(hertz: Array, targets: Targets, absolute: bool) -> Array:
    """Distances (N,) [cents] of frequencies (N,) above their targets.

    Relative to the first partial's, unless they are `absolute`.
    """
    aims, first = targets.frequencies, targets.sounding[0]
    if absolute:
        return cents(hertz, aims)
    return cents(hertz / hertz[first], aims / aims[first])


class _Descents:
    """Descents on the fine solid by the frequencies of some modes only.

    `known` are the materials that were analysed, `sought` the groups of modes whose descents all
    ended in time.
    """

    def __init__(self, problem: DesignProblem, most: int) -> None:
        setting = problem.setting
        self._targets, self._absolute = setting.objective.targets, setting.objective.absolute
        self._most = most
        self._pool = Pool(setting.fine() if setting.is_coarsened else setting, problem.workers)
        self._compared = setting.objective.compared.tolist()
        self.known = _Known(self._targets, self._absolute)
        self.sought: set[tuple[int, ...]] = set()

    def __enter__(self) -> _Descents:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.close()

    @property
    def seconds(self) -> float:
        """Processor time [s], see `Pool.seconds`."""
        return self._pool.seconds

    def look_at(self, materials: Sequence[Array]) -> None:
        """Analyse some materials."""
        self._run([Task(z) for z in materials], np.inf)
        if not len(self.known.off):
            raise UserError(
                "none of the materials that were looked at has modes that could be computed; "
                "expected a solid whose parts hang together, raise resolution"
            )

    def together(self, budget: float) -> int:
        """Number of partials from the first one on whose targets one material meets."""
        count = len(self._targets.sounding)
        for last in range(len(self._compared)):
            group = tuple(self._compared[: last + 1])
            if self.known.least(group) > HAD_CENTS:
                tasks = [self._task(group, rank) for rank in range(self._most)]
                self._run(tasks, budget)
            if self.known.least(group) > HAD_CENTS:
                return count - len(self._compared) + last
        return count

    def approach(self, groups: Sequence[tuple[int, ...]], budget: float) -> None:
        """Descend for each group of modes from the materials nearest to its targets."""
        for rank in range(self._most):
            groups = [group for group in groups if self.known.least(group) > HAD_CENTS]
            tasks = [self._task(group, rank) for group in groups]
            self.sought.update(groups[: self._run(tasks, budget)])

    def _task(self, group: tuple[int, ...], rank: int) -> Task:
        return Task(
            self.known.best(group, rank),
            options=DESCENT,
            steps=STEPS,
            objective=SomeModes(self._targets, group, self._absolute),
        )

    def _run(self, tasks: Sequence[Task], budget: float) -> int:
        """Run tasks, a few at once, and keep their materials; the number that ended within a budget
        of processor time [s].
        """
        trials: list[Trial] = []
        in_time = 0
        while len(trials) < len(tasks) and self.seconds < budget:
            limits = DescentLimits(budget - self.seconds)
            some = tasks[len(trials) : len(trials) + AT_ONCE]
            trials += self._pool.run([replace(task, limits=limits) for task in some])
            if self.seconds < budget:
                in_time = len(trials)
        self.known.add(trials)
        return in_time


def _samples(size: int) -> list[Array]:
    """Coordinates of the uniform material and of random ones, every other one smooth."""
    random = np.random.default_rng(0)
    samples = [np.zeros(size)]
    for number in range(1, SAMPLES):
        z = random.standard_normal(size)
        if number % 2:
            z /= np.arange(1, size + 1)
        samples.append(z * SPREADS[number // 2 % len(SPREADS)] / np.linalg.norm(z))
    return samples


def _beside(mode: int, compared: Sequence[int]) -> tuple[int, ...]:
    """Numbers of a partial's mode and its neighbours, without those that meet their targets by
    definition."""
    place = compared.index(mode)
    return tuple(compared[max(0, place - 1) : place + 2])


def _judged(
    mode: int,
    own: Array,
    targets: Array,
    compared: Sequence[int],
    search: _Descents | None = None,
) -> ModeReach:
    alone = beside = 0.0
    verdict = HAD
    if search is not None and abs(own[mode]) > HAD_CENTS:
        neighbours = _beside(mode, compared)
        alone, beside = search.known.least((mode,)), search.known.least(neighbours)
        verdict = NOT_TOGETHER
        if beside > HAD_CENTS:
            verdict = NOT_BESIDE if neighbours in search.sought else NOT_SOUGHT
        if alone > HAD_CENTS:
            verdict = NOT_ALONE if (mode,) in search.sought else NOT_SOUGHT
    return ModeReach(mode + 1, float(targets[mode]), float(own[mode]), alone, beside, verdict)
