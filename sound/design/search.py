"""What every optimiser works with: trials of materials, a budget, and a record of the way."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from sound.design.descent import DescentLimits
from sound.design.objective import DesignCost
from sound.design.pool import Pool, Task, Trial

Array = NDArray[np.float64]


FEWEST = 2
"""Evaluations that a descent needs: that of its start, and one to find something better."""


class BudgetSpentError(Exception):
    """Time or evaluations are used up, or somebody asked to stop."""


@dataclass(frozen=True)
class HistoryEntry:
    """The best cost known after some time [s] and evaluations."""

    seconds: float
    evaluations: int
    cost: DesignCost


class Search:
    """Runs tasks until the budget is spent.

    Parameters
    ----------
    make_pool
        Makes the processes that run them; their start counts as time of the search.
    seconds : float or None [s]
        Budget; None sets no limit.
    evaluations : int or None
        The same.  Descents that run side by side get equal shares of the evaluations that are left,
        so that what they find does not depend on which one comes first.
    watch
        Called after every round of tasks; ends the search by returning True.
    before : (float [s], int)
        Seconds and evaluations of former searches that this one goes on from.

    Attributes
    ----------
    best
        The best trial so far.
    start
        The first one.
    history
        Its cost over time.
    """

    def __init__(
        self,
        make_pool: Callable[[], Pool],
        seconds: float | None,
        evaluations: int | None,
        watch: Callable[[Search], bool] | None = None,
        before: tuple[float, int] = (0.0, 0),
    ) -> None:
        self.best: Trial | None = None
        self.start: Trial | None = None
        self.history: list[HistoryEntry] = []
        self._most = evaluations
        self._watch = watch
        self._before = before
        self._done = 0
        self._begin = time.monotonic()
        self.deadline = np.inf if seconds is None else self._begin + seconds
        self._pool = make_pool()

    def __enter__(self) -> Search:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.close()

    @property
    def own_seconds(self) -> float:
        """Seconds since this search began."""
        return time.monotonic() - self._begin

    @property
    def own_evaluations(self) -> int:
        """Evaluations of this search."""
        return self._done

    def run(self, tasks: Sequence[Task]) -> list[Trial]:
        """What becomes of the tasks.

        Raises
        ------
        BudgetSpentError
            If the budget is spent, before or after: what was found is in `best` then.  Where it is
            enough for some of the tasks only, these are run.
        """
        affordable = self._affordable(tasks)
        if not affordable:
            raise BudgetSpentError
        trials = self._pool.run(affordable)
        self._record(trials)
        stopped = self._watch is not None and self._watch(self)
        if stopped or time.monotonic() >= self.deadline or len(trials) < len(tasks):
            raise BudgetSpentError
        return trials

    def _affordable(self, tasks: Sequence[Task]) -> list[Task]:
        """The first tasks that enough evaluations are left for, with their limits."""
        if self._most is None:
            return [replace(task, limits=DescentLimits(self.deadline)) for task in tasks]
        left = self._most - self._done
        needed = 1 if all(task.options is None for task in tasks) else FEWEST
        count = min(len(tasks), left // needed)
        return [
            replace(task, limits=DescentLimits(self.deadline, left // count + (k < left % count)))
            for k, task in enumerate(tasks[:count])
        ]

    def _record(self, trials: Sequence[Trial]) -> None:
        """Add what was found, in the order of the clock, to the history."""
        now = time.monotonic()
        costs = []
        for trial in trials:
            points = [] if trial.descent is None else trial.descent.costs
            counted = 0
            for point in points:
                costs.append((point.clock, point.evaluations - counted, point.cost))
                counted = point.evaluations
            if trial.evaluations > counted:
                costs.append((now, trial.evaluations - counted, trial.cost))
            if self.start is None:
                self.start = trial
            if self.best is None or trial.cost.total < self.best.cost.total:
                self.best = trial
        for clock, evaluations, cost in sorted(costs, key=lambda each: each[0]):
            self._done += evaluations
            if not self.history or cost.total < self.history[-1].cost.total:
                self._note(clock, cost)
        self._note(now, self.history[-1].cost)

    def _note(self, clock: float, cost: DesignCost) -> None:
        seconds = self._before[0] + clock - self._begin
        self.history.append(HistoryEntry(seconds, self._before[1] + self._done, cost))
