"""Tasks shared among the processes of one machine."""

from __future__ import annotations

import os
import signal
import traceback
from collections.abc import Generator
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait

from carillon.errors import UserError
from carillon.progress import say
from dataset_gen.tasks import Dealer, Plan

QUEUE = 2
"""Tasks a worker has at a time: one in work, one to go on with."""

WINDOW = 4
"""Tasks dealt ahead of the one awaited, per worker."""


def in_this_process(plan: Plan, tasks: range) -> Generator[bytes, None, None]:
    """Results of `tasks` in order, one after the other."""
    for task in tasks:
        yield plan.work(task)


def in_workers(plan: Plan, tasks: range, workers: int) -> Generator[bytes, None, None]:
    """Results of `tasks` in order, worked out by several processes.

    The processes are fresh ones and hold nothing of this one but their end of a pipe: when this one
    ends, however it ends, they find the pipe closed and end as well.

    Raises
    ------
    UserError
        If a worker raised it, or died.
    """
    cores = len(os.sched_getaffinity(0))
    if workers > cores:
        say(f"{workers} workers share {cores} cores, more than that make nothing faster")
    crew = [_Worker(plan) for _ in range(min(workers, len(tasks)))]
    dealer = Dealer(tasks, WINDOW * len(crew))
    try:
        free = crew * QUEUE
        while not dealer.finished:
            while free and (task := dealer.deal()) is not None:
                free.pop(0).begin(task)
            for worker in _with_results(crew):
                dealer.keep(*worker.result())
                free.append(worker)
            yield from dealer.ready()
    finally:
        for worker in crew:
            worker.stop()


class _Worker:
    """A process that takes task numbers from a pipe and puts results into it."""

    def __init__(self, plan: Plan) -> None:
        # Neither forked, as threads do not survive that, nor sharing files with its siblings.
        context = get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=_serve, args=(plan, theirs), daemon=True)
        self.process.start()
        theirs.close()

    def begin(self, task: int) -> None:
        """Hand over a task."""
        with suppress(BrokenPipeError):  # how it died is told by `result`
            self.pipe.send(task)

    def result(self) -> tuple[int, bytes]:
        """A finished task and what came out."""
        try:
            found = self.pipe.recv()
        except (EOFError, ConnectionResetError):
            self.process.join()
            raise UserError(
                f"a worker died with exit code {self.process.exitcode} (-9: killed, perhaps for "
                "lack of memory); run the same command again, with fewer workers"
            ) from None
        if isinstance(found, BaseException):
            raise found
        task, work = found
        return task, work

    def stop(self) -> None:
        """End the process, whatever it is doing: it owns nothing."""
        self.pipe.close()
        self.process.terminate()
        self.process.join()


def _with_results(crew: list[_Worker]) -> list[_Worker]:
    """Workers whose pipe has something to read; waits until there is one."""
    ready = wait([worker.pipe for worker in crew])
    return [worker for worker in crew if worker.pipe in ready]


def _serve(plan: Plan, pipe: Connection) -> None:
    """Do tasks until the pipe is closed; an exception goes through the pipe as well."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    with suppress(EOFError, ConnectionResetError, BrokenPipeError):
        while True:
            task = pipe.recv()
            try:
                pipe.send((task, plan.work(task)))
            except UserError as error:
                pipe.send(error)
            except Exception:
                pipe.send(RuntimeError(f"in a worker:\n{traceback.format_exc()}"))
