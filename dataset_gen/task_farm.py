"""A farm of tasks: this process, and workers that it sends numbers to and gets rows from."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Protocol

from dataset_gen.tasks import ShardPlan

QUEUE = 2
"""Tasks that each process has at a time: one in work, one to go on with."""

WINDOW = 4
"""Tasks handed out ahead of the one awaited, per process."""


class Workers(Protocol):
    """The other processes of a farm, numbered from 0."""

    def __len__(self) -> int:
        """How many they are."""

    def send(self, worker: int, task: int) -> None:
        """Give one of them a task."""

    def receive(self) -> tuple[int, int, bytes] | None:
        """Who has done which task, and its rows; None if nobody has after a moment's waiting."""


def run(plan: ShardPlan, tasks: range, workers: Workers) -> Generator[bytes, None, None]:
    """Results of `tasks` in order, from the workers and from a thread of this process."""
    queue = OrderedQueue(tasks, WINDOW * (len(workers) + 1))
    free = list(range(len(workers))) * QUEUE
    own: list[tuple[int, Future[bytes]]] = []
    thread = ThreadPoolExecutor(1)
    try:
        while not queue.finished:
            while free and (task := queue.next_task()) is not None:
                workers.send(free.pop(0), task)
            while len(own) < QUEUE and (task := queue.next_task()) is not None:
                own.append((task, thread.submit(plan.work, task)))
            while own and own[0][1].done():
                task, future = own.pop(0)
                queue.put(task, future.result())
            if (result := workers.receive()) is not None:
                worker, task, rows = result
                queue.put(task, rows)
                free.append(worker)
            yield from queue.ready()
    finally:
        thread.shutdown(cancel_futures=True)


class OrderedQueue:
    """Hands out tasks in order to whoever is free and keeps results until it is their turn.

    No task is handed out that is `window` or more ahead of the one awaited, so that not more than
    `window` results are kept however slow one of the processes is.
    """

    def __init__(self, tasks: range, window: int) -> None:
        self._next = self._awaited = tasks.start
        self._stop = tasks.stop
        self._window = window
        self._results: dict[int, bytes] = {}

    @property
    def finished(self) -> bool:
        """Whether every result has been handed on."""
        return self._awaited == self._stop

    def next_task(self) -> int | None:
        """The next task; None if there is none or others have to be finished first."""
        if self._next == min(self._stop, self._awaited + self._window):
            return None
        self._next += 1
        return self._next - 1

    def put(self, task: int, result: bytes) -> None:
        """Take a result."""
        self._results[task] = result

    def ready(self) -> Iterator[bytes]:
        """Results whose turn it is."""
        while self._awaited in self._results:
            yield self._results.pop(self._awaited)
            self._awaited += 1
