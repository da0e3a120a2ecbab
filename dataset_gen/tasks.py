"""The work on a shard, cut into tasks that any process can do and that end up in order."""

import logging
from collections.abc import Generator
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from carillon.errors import UserError
from carillon.processes import children
from carillon.processes.threads import allowed_cores
from dataset_gen.objectives import fit_samples
from dataset_gen.sampling import samples
from dataset_gen.settings import Settings

TASK_ROWS = 8192
"""Samples of a task: whole hypercubes, cheap to hand out, a fraction of a second's work."""
ROW = np.dtype(
    [("fine", "<f8", (8,)), ("coarse", "<f8", (8,)), ("residual", "<f8"), ("converged", "?")]
)
"""A sample with its fit, packed as it passes between processes and into the journal."""

logger = logging.getLogger(__name__)

WINDOW = 4
"""Tasks of each process that are at work or wait for their turn."""


@dataclass(frozen=True)
class ShardPlan:
    """A shard's settings and the samples of each task; the last task may have fewer."""

    settings: Settings
    task_rows: int = TASK_ROWS

    @property
    def tasks(self) -> int:
        """Number of tasks."""
        return -(-self.settings.count // self.task_rows)

    def rows(self, tasks: int) -> int:
        """Samples of the first `tasks` tasks."""
        return min(tasks * self.task_rows, self.settings.count)

    def size(self, task: int) -> int:
        """Bytes of what `work` returns for a task."""
        return (self.rows(task + 1) - self.rows(task)) * ROW.itemsize

    def work(self, task: int) -> bytes:
        """Draw and fit the samples of one task; the bytes of its rows."""
        settings = self.settings
        first, past = (settings.start + self.rows(t) for t in (task, task + 1))
        young = samples(settings.seed, first, past, settings.moduli)
        fits = fit_samples(settings.objective, young, settings.seed, first, settings.poisson)
        rows = np.empty(len(young), dtype=ROW)
        rows["fine"], rows["coarse"] = young, fits.moduli
        rows["residual"], rows["converged"] = fits.residual, fits.converged
        return rows.tobytes()


def rows_of(work: bytes) -> NDArray[np.void]:
    """Rows of type `ROW` from their bytes."""
    return np.frombuffer(work, dtype=ROW)


def in_this_process(plan: ShardPlan, tasks: range) -> Generator[bytes, None, None]:
    """Results of `tasks` in order, one after the other."""
    for task in tasks:
        yield plan.work(task)


def in_workers(plan: ShardPlan, tasks: range, workers: int) -> Generator[bytes, None, None]:
    """Results of `tasks` in order, from so many processes, which end with this one.

    Raises UserError if a worker raised it, or died.
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
