"""Tasks shared among MPI ranks: rank 0 writes what all of them work out."""

from __future__ import annotations

import logging
import os
import time
from collections.abc import Callable, Generator
from dataclasses import dataclass
from functools import partial

from carillon.errors import LocalUserError, UserError
from carillon.processes.ranks import Comm, alone
from dataset_gen import task_farm
from dataset_gen.generate import Engine
from dataset_gen.tasks import ShardPlan

logger = logging.getLogger(__name__)

PAUSE = 1e-3
"""Seconds between two looks for messages, so that waiting takes no core from the work."""


def run_on_ranks(comm: Comm, make: Callable[[Engine], int]) -> int:
    """Call `make` on rank 0 with an engine for which all ranks work; its exit status on every rank.

    Raises
    ------
    UserError
        On every rank if `make` raises it before the ranks have begun to work.
    LocalUserError
        On the one rank that raised it later, see `exit_status.run`, which ends all of them.
    """
    _warn_about_cores(comm)
    if comm.rank > 0:
        return _follow(comm)
    busy: list[ShardPlan] = []
    try:
        status = make(partial(_on_ranks, comm, busy))
    except UserError as error:
        if not busy:
            _end(comm, _Refusal(str(error)))
            raise
        raise LocalUserError(str(error)) from error
    if busy:  # interrupted, with the others in the middle of their work
        comm.Abort(status)
    _end(comm, _End(status))
    return status


@dataclass(frozen=True)
class _End:
    """Message to the other ranks that there is no more work, with the status to end with."""

    status: int


@dataclass(frozen=True)
class _Refusal:
    """Message to the other ranks that there is no work, and why."""

    sentence: str


def _end(comm: Comm, message: _End | _Refusal) -> None:
    for rank in range(1, comm.size):
        comm.send(message, dest=rank)


def _on_ranks(
    comm: Comm, busy: list[ShardPlan], plan: ShardPlan, tasks: range
) -> Generator[bytes, None, None]:
    """Results of `tasks` in order, from all ranks."""
    busy.append(plan)
    for rank in range(1, comm.size):
        comm.send(plan, dest=rank)
    yield from task_farm.run(plan, tasks, _OtherRanks(comm))
    busy.clear()


class _OtherRanks:
    """The other ranks, as rank 0 sees them."""

    def __init__(self, comm: Comm) -> None:
        self._comm = comm

    def __len__(self) -> int:
        return int(self._comm.size) - 1

    def send(self, worker: int, task: int) -> None:
        """Hand over a task."""
        self._comm.send(task, dest=worker + 1)

    def receive(self) -> tuple[int, int, bytes] | None:
        """A finished task, if there is one after a `PAUSE`."""
        if not self._comm.iprobe():
            time.sleep(PAUSE)
            if not self._comm.iprobe():
                return None
        rank, task, rows = self._comm.recv()
        return rank - 1, task, rows


def _follow(comm: Comm) -> int:
    """Do the tasks that rank 0 hands out until it says that this is the end."""
    plan: ShardPlan | None = None
    while True:
        while not comm.iprobe(source=0):
            time.sleep(PAUSE)
        message = comm.recv(source=0)
        if isinstance(message, _End):
            return message.status
        if isinstance(message, _Refusal):
            raise UserError(message.sentence)
        if isinstance(message, ShardPlan):
            plan = message
            continue
        assert plan is not None
        with alone():
            rows = plan.work(message)
        # Blocks until rank 0 takes it, which is at once: it does not wait for its own work.
        comm.send((comm.rank, message, rows), dest=0)


def _warn_about_cores(comm: Comm) -> None:
    """Say so if the ranks of a machine are more than the cores they may run on together."""
    from mpi4py import MPI

    node = comm.Split_type(MPI.COMM_TYPE_SHARED)
    cores = set[int]().union(*node.allgather(os.sched_getaffinity(0)))
    if node.rank == 0 and node.size > len(cores):
        logger.warning(
            f"{node.size} ranks share {len(cores)} cores, more than that make nothing faster"
        )
    node.Free()
