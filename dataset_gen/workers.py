"""Tasks shared among the processes of one machine."""

from __future__ import annotations

import logging
from collections.abc import Generator
from concurrent.futures.process import BrokenProcessPool

from carillon.errors import UserError
from carillon.processes import children
from carillon.processes.threads import allowed_cores
from dataset_gen.tasks import ShardPlan

logger = logging.getLogger(__name__)

WINDOW = 4
"""Tasks of each process that are at work or wait for their turn."""


def in_this_process(plan: ShardPlan, tasks: range) -> Generator[bytes, None, None]:
    """Results of `tasks` in order, one after the other."""
    for task in tasks:
        yield plan.work(task)


def in_workers(plan: ShardPlan, tasks: range, workers: int) -> Generator[bytes, None, None]:
    """Results of `tasks` in order, from so many processes, which end with this one.

    Raises
    ------
    UserError
        If a worker raised it, or died.
    """
    cores = allowed_cores()
    if workers > cores:
        logger.warning(f"{workers} workers share {cores} cores, more than that make nothing faster")
    pool = children.ProcessPool(min(workers, len(tasks)))
    try:
        yield from pool.in_order(plan.work, tasks, WINDOW * workers)
    except BrokenProcessPool:
        raise UserError(
            f"a worker died with exit code {pool.failure()} (-9: killed, perhaps for lack of "
            "memory); run the same command again, with fewer workers"
        ) from None
    finally:
        pool.close()
