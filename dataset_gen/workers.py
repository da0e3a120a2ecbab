"""Tasks shared among the processes of one machine."""

from __future__ import annotations

import logging
import os
import signal
import traceback
from collections.abc import Generator
from contextlib import suppress
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait

from carillon.errors import UserError
from dataset_gen import task_farm
from dataset_gen.tasks import ShardPlan

logger = logging.getLogger(__name__)

PATIENCE = 1e-2
"""Seconds to wait for the other processes at most; a result ends the waiting at once."""


def in_this_process(plan: ShardPlan, tasks: range) -> Generator[bytes, None, None]:
    """Results of `tasks` in order, one after the other."""
    for task in tasks:
        yield plan.work(task)


def in_workers(plan: ShardPlan, tasks: range, workers: int) -> Generator[bytes, None, None]:
    """Results of `tasks` in order, worked out by this process and `workers - 1` others.

    The others are fresh processes and hold nothing of this one but their end of a pipe: when this
    one ends, however it ends, they find the pipe closed and end as well.

    Raises
    ------
    UserError
        If a worker raised it, or died.
    """
    cores = len(os.sched_getaffinity(0))
    if workers > cores:
        logger.warning(f"{workers} workers share {cores} cores, more than that make nothing faster")
    others = _Processes(plan, min(workers, len(tasks)) - 1)
    try:
        yield from task_farm.run(plan, tasks, others)
    finally:
        others.stop()


class _Processes:
    """Processes that take task numbers from pipes and put results into them."""

    def __init__(self, plan: ShardPlan, count: int) -> None:
        # Neither forked, as threads do not survive that, nor sharing files with their siblings.
        context = get_context("spawn")
        self._pipes: list[Connection] = []
        self._processes = []
        for _ in range(count):
            ours, theirs = context.Pipe()
            process = context.Process(target=_serve, args=(plan, theirs), daemon=True)
            process.start()
            theirs.close()
            self._pipes.append(ours)
            self._processes.append(process)

    def __len__(self) -> int:
        return len(self._pipes)

    def send(self, worker: int, task: int) -> None:
        """Hand over a task."""
        with suppress(BrokenPipeError):  # how it died is told by `receive`
            self._pipes[worker].send(task)

    def receive(self) -> tuple[int, int, bytes] | None:
        """A finished task, if there is one within `PATIENCE`."""
        ready = wait(self._pipes, PATIENCE)
        if not ready:
            return None
        worker = next(k for k, pipe in enumerate(self._pipes) if pipe is ready[0])
        try:
            result = self._pipes[worker].recv()
        except (EOFError, ConnectionResetError):
            self._processes[worker].join()
            raise UserError(
                f"a worker died with exit code {self._processes[worker].exitcode} (-9: killed, "
                "perhaps for lack of memory); run the same command again, with fewer workers"
            ) from None
        if isinstance(result, BaseException):
            raise result
        task, rows = result
        return worker, task, rows

    def stop(self) -> None:
        """End the processes, whatever they are doing: they own nothing."""
        for pipe, process in zip(self._pipes, self._processes):
            pipe.close()
            process.terminate()
            process.join()


def _serve(plan: ShardPlan, pipe: Connection) -> None:
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
