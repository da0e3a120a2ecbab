"""Materials evaluated side by side, each by one thread of one process.

What is found depends on the coordinates and on the modes that the evaluation starts from, and on
nothing that another task has done.  So results do not depend on how many processes share the work.
"""

import os
import pickle
import sys
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_EXCEPTION, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from dataclasses import replace
from functools import cache
from multiprocessing.queues import SimpleQueue
from tempfile import TemporaryDirectory, TemporaryFile
from threading import Thread
from typing import IO

from carillon.errors import ConvergenceError, UserError
from carillon.processes import children
from carillon.processes.threads import one_thread
from sound.design.descent import Descent, DesignDescent, cost_of, normal_equations
from sound.design.local_search import LimitedMemory, StepOptions, descend, descend_by_gradients
from sound.design.objective import DesignCost
from sound.design.reduced_model import TrustRegion, descend_by_model
from sound.design.simulation import Evaluation, Simulation
from sound.design.tasks import FAILED, SearchStep, Setting, Task, Trial

LISTEN_SECONDS = 0.1
"""Time between two looks whether somebody asked to stop, while processes work."""


class InterruptedRoundError(Exception):
    """Somebody asked to stop in the middle of a round: its processes are gone."""


class Pool:
    """Processes that evaluate materials; this one alone if `workers` is 1.

    `tell` is called with every step of a descent, from another thread if there are several
    processes.  Time is that of processors, so that other work on the machine does not change what
    is found in a given time.
    """

    def __init__(
        self, setting: Setting, workers: int, tell: Callable[[SearchStep], None] | None = None
    ) -> None:
        self._pool: children.ProcessPool | None = None
        self._held = ExitStack()
        self._rounds, self._apart = 0, 0.0
        if workers == 1:
            self._held.enter_context(one_thread())
            _prepare(setting, tell)
            self._begin = time.thread_time()
            return
        steps = None
        if tell is not None:
            steps = children.CONTEXT.SimpleQueue()
            Thread(target=_pass_on, args=(steps, tell), daemon=True).start()
        # What processes are started with has to fit into a pipe, or one that died before it had
        # read all would be waited for. So they read the setting from a file, which has no name.
        file, path = self._nameless_file()
        pickle.dump(setting, file)
        file.flush()
        self._pool = children.ProcessPool(workers, _prepare_apart, path, steps)
        self._begin = time.thread_time()

    def _nameless_file(self) -> tuple[IO[bytes], str]:
        """A file for other processes to read while the pool lives, and the path that they open.

        Where the system gives none to files without a name, it has one.
        """
        if sys.platform == "linux" and os.path.isdir("/proc/self/fd"):
            file = self._held.enter_context(TemporaryFile())
            return file, f"/proc/{os.getpid()}/fd/{file.fileno()}"
        folder = self._held.enter_context(TemporaryDirectory())
        named = self._held.enter_context(open(os.path.join(folder, "setting"), "wb"))
        return named, named.name

    @property
    def seconds(self) -> float:
        """Processor time [s] since the processes were started: of the thread that runs the tasks,
        and, in each round, of the process that took longest.
        """
        return time.thread_time() - self._begin + self._apart

    def run(
        self, tasks: Sequence[Task], interrupted: Callable[[], bool] | None = None
    ) -> list[Trial]:
        """What becomes of the tasks, in their order.

        Raises InterruptedRoundError if `interrupted`, which is asked now and then where there are
        several processes, says so before all is done, and UserError if a process died.
        """
        self._rounds += 1
        if self._pool is None:
            return [_run(task, self._rounds) for task in tasks]
        try:
            futures = [self._pool.submit(_run, task, self._rounds) for task in tasks]
            while wait(futures, LISTEN_SECONDS, FIRST_EXCEPTION).not_done:
                if interrupted is not None and interrupted():
                    self.close()
                    raise InterruptedRoundError
            trials = [future.result() for future in futures]
        except BrokenProcessPool:
            raise UserError(
                "a process that evaluates materials died, perhaps for lack of memory; run the same "
                "command again, with fewer workers"
            ) from None
        self._apart += max(trial.seconds for trial in trials)
        return trials

    def close(self) -> None:
        """End the processes, whatever they are doing."""
        self._held.close()
        if self._pool is not None:
            self._pool.close()


_setting: Setting
_simulation: Simulation
_tell: Callable[[SearchStep], None] | None
_round: tuple[int, float]
"""Number of the round of tasks, and the processor time [s] of this thread when it began here."""
_for_good = ExitStack()


def _pass_on(steps: SimpleQueue[SearchStep], tell: Callable[[SearchStep], None]) -> None:
    while True:
        tell(steps.get())


def _prepare_apart(path: str, steps: SimpleQueue[SearchStep] | None) -> None:
    _for_good.enter_context(one_thread())
    with open(path, "rb") as file:
        setting = pickle.load(file)
    _prepare(setting, None if steps is None else steps.put)


def _prepare(setting: Setting, tell: Callable[[SearchStep], None] | None) -> None:
    global _setting, _simulation, _tell, _round
    _setting, _simulation, _tell = setting, setting.simulation(), tell
    _round = (0, 0.0)
    _fine_simulation.cache_clear()


@cache
def _fine_simulation() -> Simulation:
    return _setting.fine().simulation()


def _run(task: Task, number: int) -> Trial:
    """Do a task of a round; from nothing if its start leads nowhere and an evaluation is left for
    that.
    """
    global _round
    if number != _round[0]:
        _round = (number, time.thread_time())
    task = replace(task, limits=replace(task.limits, begin=_round[1]))
    simulation = _fine_simulation() if task.fine else _simulation
    before, most = simulation.evaluations, task.limits.evaluations
    trial = Trial(task.z, FAILED, 0)
    for start in (task.start, None) if task.start is not None else (None,):
        left = most - (simulation.evaluations - before)
        if left < 1:
            break
        limits = replace(task.limits, evaluations=left)
        try:
            trial = _done(simulation, replace(task, start=start, limits=limits))
            break
        except ConvergenceError:
            continue
    made = simulation.evaluations - before
    return replace(trial, evaluations=made, seconds=task.limits.spent)


def _telling(fine: bool) -> Callable[[Evaluation, DesignCost], None] | None:
    tell = _tell
    if tell is None:
        return None

    def pass_on(evaluation: Evaluation, cost: DesignCost) -> None:
        seconds = time.thread_time() - _round[1]
        tell(SearchStep(evaluation.z, cost, evaluation.eigenvalues, fine, seconds))

    return pass_on


def _descent(
    simulation: Simulation, task: Task, options: StepOptions | LimitedMemory | TrustRegion
) -> DesignDescent:
    limits = replace(task.limits, tell=_telling(task.fine))
    descent = Descent(simulation, task.objective or _setting.objective, limits)
    if isinstance(options, LimitedMemory):
        evaluations = task.steps * options.evaluations
        return descend_by_gradients(descent, task.z, task.start, evaluations)
    if isinstance(options, TrustRegion):
        radius = task.damping[0] if task.damping else options.radius
        return descend_by_model(descent, task.z, task.start, task.steps, radius)
    return descend(descent, task.z, task.start, options, task.steps, task.damping)


def _done(simulation: Simulation, task: Task) -> Trial:
    if task.options is not None:
        descent = _descent(simulation, task, task.options)
        last = descent.last
        assert last is not None
        return Trial(
            last.z,
            descent.cost,
            descent.evaluations,
            descent=replace(descent, last=None),
            start=last.modes.start(),
            eigenvalues=last.eigenvalues,
        )
    objective = task.objective or _setting.objective
    evaluation = simulation.evaluate(task.z, task.start, task.gradient)
    cost = cost_of(objective, simulation.material, evaluation)
    if not task.gradient:
        return Trial(task.z, cost, 1, eigenvalues=evaluation.eigenvalues)
    gradient = normal_equations(objective, simulation.material, evaluation)[1]
    start = evaluation.modes.start()
    return Trial(task.z, cost, 1, gradient, start=start, eigenvalues=evaluation.eigenvalues)
