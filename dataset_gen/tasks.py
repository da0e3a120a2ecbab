"""The work on a shard, cut into tasks that any process can do and that end up in order."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dataset_gen.objectives import fit
from dataset_gen.sampling import samples
from dataset_gen.settings import Settings

TASK_ROWS = 4096
"""Samples of a task: a multiple of a hypercube's, and a second's work or less."""

ROW = np.dtype(
    [("fine", "<f8", (8,)), ("coarse", "<f8", (8,)), ("residual", "<f8"), ("converged", "?")]
)
"""A sample with its fit, packed as it passes between processes and into the journal."""


@dataclass(frozen=True)
class Plan:
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
        fits = fit(settings.objective, young, settings.poisson)
        rows = np.empty(len(young), dtype=ROW)
        rows["fine"], rows["coarse"] = young, fits.moduli
        rows["residual"], rows["converged"] = fits.residual, fits.converged
        return rows.tobytes()


def rows_of(work: bytes) -> NDArray[np.void]:
    """Rows of type `ROW` from their bytes."""
    return np.frombuffer(work, dtype=ROW)


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
