"""Tasks dealt to a crew: this process, and others that it sends numbers to and gets rows from."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Protocol

from dataset_gen.tasks import Plan

QUEUE = 2
"""Tasks that each has at a time: one in work, one to go on with."""

WINDOW = 4
"""Tasks dealt ahead of the one awaited, per process."""


class Others(Protocol):
    """The other processes of a crew, numbered from 0."""

    def __len__(self) -> int:
        """How many they are."""

    def send(self, other: int, task: int) -> None:
        """Give one of them a task."""

    def receive(self) -> tuple[int, int, bytes] | None:
        """Who has done which task, and its rows; None if nobody has after a moment's waiting."""


def lead(plan: Plan, tasks: range, others: Others) -> Generator[bytes, None, None]:
    """Results of `tasks` in order, from the others and from a thread of this process."""
    dealer = Dealer(tasks, WINDOW * (len(others) + 1))
    free = list(range(len(others))) * QUEUE
    own: list[tuple[int, Future[bytes]]] = []
    thread = ThreadPoolExecutor(1)
    try:
        while not dealer.finished:
            while free and (task := dealer.deal()) is not None:
                others.send(free.pop(0), task)
            while len(own) < QUEUE and (task := dealer.deal()) is not None:
                own.append((task, thread.submit(plan.work, task)))
            while own and own[0][1].done():
                task, future = own.pop(0)
                dealer.keep(task, future.result())
            if (found := others.receive()) is not None:
                other, task, work = found
                dealer.keep(task, work)
                free.append(other)
            yield from dealer.ready()
    finally:
        thread.shutdown(cancel_futures=True)


class Dealer:
    """Deals tasks in order to whoever is free and keeps results until it is their turn.

    No task is dealt that is `window` or more ahead of the one awaited, so that not more than
    `window` results are kept however slow one of the processes is.
    """

    def __init__(self, tasks: range, window: int) -> None:
        self._next = self._awaited = tasks.start
        self._stop = tasks.stop
        self._window = window
        self._kept: dict[int, bytes] = {}

    @property
    def finished(self) -> bool:
        """Whether every result has been handed on."""
        return self._awaited == self._stop

    def deal(self) -> int | None:
        """The next task; None if there is none or others have to be finished first."""
        if self._next == min(self._stop, self._awaited + self._window):
            return None
        self._next += 1
        return self._next - 1

    def keep(self, task: int, work: bytes) -> None:
        """Take a result."""
        self._kept[task] = work

    def ready(self) -> Iterator[bytes]:
        """Results whose turn it is."""
        while self._awaited in self._kept:
            yield self._kept.pop(self._awaited)
            self._awaited += 1
