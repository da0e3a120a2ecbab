"""A search within a budget: trials of materials, and their history."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NoReturn

import numpy as np

from carillon.errors import UserError
from sound.design.descent import DescentLimits
from sound.design.objective import DesignCost, Objective
from sound.design.pool import InterruptedRoundError, Pool
from sound.design.tasks import SearchStep, Task, Trial

FEWEST = 2
"""Least number of evaluations of a descent: that of its start, and one of a step."""
LEAST_LEG = 8
"""Least number of evaluations of a leg: two of each of four descents side by side."""
LEAST_LEG_SECONDS = 2.0
"""Least duration of a leg, over the time that is reserved for the check after it."""
ENDLESS_SECONDS = 60.0
"""Duration [s] that legs are shares of in a search without a budget."""


UNDER_WAY, BUDGET, INTERRUPT, MET = "", "budget", "interrupt", "met"
"""Endings of a search: none yet, its budget is used up, someone interrupted it, or its frequencies
are met and its cost falls no more."""


class BudgetSpentError(Exception):
    """Time or evaluations are used up, or an interrupt came."""


@dataclass(frozen=True)
class HistoryEntry:
    """The best cost after some processor time [s] and evaluations."""

    seconds: float
    evaluations: int
    cost: DesignCost


@dataclass(frozen=True)
class CheckEntry:
    """Result of a check of a material on the fine solid, after some time and evaluations of the
    search.

    `coarse_rms_cents` and `fine_rms_cents` are root mean square distances of coarse and fine
    frequencies from the targets, each up to the best common factor; `foretold_rms_cents` is that of
    the fine frequencies from those that the search expected.  `cost` is that of the fine solid, Eq.
    (4).
    """

    seconds: float
    evaluations: int
    coarse_rms_cents: float
    fine_rms_cents: float
    foretold_rms_cents: float
    cost: float


class Search:
    """Runs tasks until the budget of time [s] and of evaluations is spent; None sets no limit.

    Time is processor time, see `Pool.seconds`, so that a busy machine does not end a search early.
    Descents that run side by side get equal shares of the evaluations that are left, so their
    results do not depend on which one is faster.

    Parameters
    ----------
    make_pool
        Makes the pool of processes, from a function that receives their steps; time counts from
        then on.
    watch, interrupted
        Called after every round of tasks, and during it; each ends the search by returning True.
        Of an interrupted round the best step is kept, but its evaluations do not count.
    before : (float [s], int)
        Time and evaluations of former searches that this one continues.

    Attributes
    ----------
    best, start
        Best trial of the present leg, and first trial of all.
    history, checks, best_checked
        Best cost over time, which may rise where a leg begins; checks on the fine solid, see
        `sound.design.space_mapping`, and the best trial by them.
    spent
        Whether the whole budget is used up, or an interrupt came.
    ending
        What ended the search, such as `BUDGET`.
    """

    def __init__(
        self,
        make_pool: Callable[[Callable[[SearchStep], None]], Pool],
        seconds: float | None,
        evaluations: int | None,
        watch: Callable[[Search], bool] | None = None,
        before: tuple[float, int] = (0.0, 0),
        interrupted: Callable[[], bool] | None = None,
    ) -> None:
        self.best: Trial | None = None
        self.start: Trial | None = None
        self.history: list[HistoryEntry] = []
        self.spent = False
        self.ending = UNDER_WAY
        self.checks: list[CheckEntry] = []
        self.best_checked: Trial | None = None
        self._objective: Objective | None = None
        self._is_last = True
        self._most = self._leg_most = evaluations
        self._watch = watch
        self._before = before
        self._interrupted = interrupted
        self._step: SearchStep | None = None
        self._done = 0
        self._budget = self._leg_budget = np.inf if seconds is None else seconds
        self._pool = make_pool(self._told)

    def __enter__(self) -> Search:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.close()

    @property
    def own_seconds(self) -> float:
        """Processor time [s] of this search."""
        return self._pool.seconds

    @property
    def endless(self) -> bool:
        """Whether the search has no budget."""
        return self._most is None and not np.isfinite(self._budget)

    @property
    def own_evaluations(self) -> int:
        """Evaluations of this search."""
        return self._done

    def begin_leg(self, objective: Objective | None, share: float, reserve: float) -> None:
        """Begin a leg with a share of the remaining budget, and with an objective of its own if
        given.

        `best` is that of the leg from now on.  `reserve` seconds are kept for the check after it; a
        leg that would leave too little for another one is the last.
        """
        self.best, self._objective = None, objective
        self._is_last = False
        now = self.own_seconds
        left = self._budget - now
        if np.isfinite(left):
            seconds = max(share * left, LEAST_LEG_SECONDS * reserve)
            self._is_last = left - seconds <= (LEAST_LEG_SECONDS + 2.0) * reserve
            self._leg_budget = now + (left - reserve if self._is_last else seconds)
        elif self._most is None:
            self._leg_budget = now + share * ENDLESS_SECONDS
        if self._most is not None:
            evaluations = max(round(share * (self._most - self._done)), LEAST_LEG)
            if self._most - self._done - evaluations < LEAST_LEG:
                self._is_last = True
            self._leg_most = self._most if self._is_last else self._done + evaluations

    def run(self, tasks: Sequence[Task]) -> list[Trial]:
        """Run tasks; of those that the budget of the leg does not suffice for, the first ones.

        Raises BudgetSpentError if that is spent, before or after; the best trial is in `best`.
        """
        begin = self.own_seconds
        affordable = self._affordable(tasks, self._leg_budget - begin)
        if not affordable or begin >= self._leg_budget:
            self._end()
        self._step = None
        try:
            # Without a first material there would be no design to write.
            trials = self._pool.run(affordable, self._interrupted if self.start else None)
        except InterruptedRoundError:
            self._break_off(begin)
        self._record(trials, begin)
        if self._watch is not None and self._watch(self):
            self._is_last = True
            self._end(INTERRUPT)
        if self.own_seconds >= self._leg_budget or len(trials) < len(tasks):
            self._end()
        return trials

    def _told(self, step: SearchStep) -> None:
        if self._step is None or step.cost.total < self._step.cost.total:
            self._step = step

    def _break_off(self, begin: float) -> NoReturn:
        step = self._step
        if step is not None:
            self._record([Trial(step.z, step.cost, 0, eigenvalues=step.eigenvalues)], begin)
        self._is_last = True
        self._end(INTERRUPT)

    def _end(self, ending: str = BUDGET) -> NoReturn:
        self.spent = self._is_last
        if self.spent:
            self.ending = ending
        raise BudgetSpentError

    def _affordable(self, tasks: Sequence[Task], seconds: float) -> list[Task]:
        tasks = [replace(task, objective=self._objective) for task in tasks]
        if self._leg_most is None:
            return [replace(task, limits=DescentLimits(seconds)) for task in tasks]
        left = self._leg_most - self._done
        needed = 1 if all(task.options is None for task in tasks) else FEWEST
        count = min(len(tasks), left // needed)
        return [
            replace(task, limits=DescentLimits(seconds, left // count + (k < left % count)))
            for k, task in enumerate(tasks[:count])
        ]

    def _record(self, trials: Sequence[Trial], begin: float) -> None:
        """Take up the trials of a round that began after so many seconds of this search."""
        now = self.own_seconds
        costs = []
        lowest = np.inf if self.best is None else self.history[-1].cost.total
        for trial in trials:
            points = [] if trial.descent is None else trial.descent.costs
            counted = 0
            for point in points:
                costs.append((begin + point.seconds, point.evaluations - counted, point.cost))
                counted = point.evaluations
            if trial.evaluations > counted:
                costs.append((now, trial.evaluations - counted, trial.cost))
            if self.start is None:
                self.start = trial
            if self.best is None or trial.cost.total < self.best.cost.total:
                self.best = trial
        for seconds, evaluations, cost in sorted(costs, key=lambda each: each[0]):
            self._done += evaluations
            if cost.total < lowest or not self.history:
                lowest = cost.total
                self._note(seconds, cost)
        self._note(now, self.history[-1].cost)

    def _note(self, seconds: float, cost: DesignCost) -> None:
        spent = self._before[0] + seconds
        self.history.append(HistoryEntry(spent, self._before[1] + self._done, cost))


def require_modes(search: Search) -> Trial:
    """The first trial of a search, refused if it has no modes."""
    if search.start is None or not np.isfinite(search.start.cost.total):
        raise UserError(
            "the material to start from has no modes that could be computed; expected a solid "
            "whose parts hang together, raise resolution"
        )
    return search.start
