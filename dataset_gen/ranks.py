"""Tasks shared among MPI ranks: rank 0 writes what all of them work out."""

from __future__ import annotations

import logging
import os
import sys
import time
from collections.abc import Callable, Generator
from functools import partial

from carillon.cli import EXIT_BAD_INPUT
from carillon.errors import UserError
from carillon.ranks import Comm, give_up
from dataset_gen.crew import lead
from dataset_gen.generate import Engine
from dataset_gen.tasks import Plan

logger = logging.getLogger(__name__)

PAUSE = 1e-3
"""Seconds between two looks for messages, so that waiting takes no core from the work."""


def share(comm: Comm, program: str, make: Callable[[Engine], int]) -> int:
    """Call `make` on rank 0 with an engine for which all ranks work; its exit status on every rank.

    An error on any rank is printed there and ends all of them.
    """
    busy: list[Plan] = []
    try:
        _warn_about_cores(comm)
        if comm.rank > 0:
            return _follow(comm)
        status = make(partial(_in_ranks, comm, busy))
        if busy:  # interrupted, with the others in the middle of their work
            comm.Abort(status)
    except UserError as error:
        print(f"{program}: {error}", file=sys.stderr, flush=True)
        if busy or comm.rank > 0:
            comm.Abort(EXIT_BAD_INPUT)
        status = EXIT_BAD_INPUT
    except BaseException as error:
        give_up(comm, program, error)
    for rank in range(1, comm.size):
        comm.send(_End(status), dest=rank)
    return status


class _End:
    """Message to the other ranks that there is no more work, with the status to end with."""

    def __init__(self, status: int) -> None:
        self.status = status


def _in_ranks(
    comm: Comm, busy: list[Plan], plan: Plan, tasks: range
) -> Generator[bytes, None, None]:
    """Results of `tasks` in order, from all ranks."""
    busy.append(plan)
    for rank in range(1, comm.size):
        comm.send(plan, dest=rank)
    yield from lead(plan, tasks, _Ranks(comm))
    busy.clear()


class _Ranks:
    """The other ranks, as rank 0 sees them."""

    def __init__(self, comm: Comm) -> None:
        self._comm = comm

    def __len__(self) -> int:
        return int(self._comm.size) - 1

    def send(self, other: int, task: int) -> None:
        """Hand over a task."""
        self._comm.send(task, dest=other + 1)

    def receive(self) -> tuple[int, int, bytes] | None:
        """A finished task, if there is one after a `PAUSE`."""
        if not self._comm.iprobe():
            time.sleep(PAUSE)
            if not self._comm.iprobe():
                return None
        rank, task, work = self._comm.recv()
        return rank - 1, task, work


def _follow(comm: Comm) -> int:
    """Do the tasks that rank 0 deals until it says that this is the end."""
    plan: Plan | None = None
    while True:
        while not comm.iprobe(source=0):
            time.sleep(PAUSE)
        order = comm.recv(source=0)
        if isinstance(order, _End):
            return order.status
        if isinstance(order, Plan):
            plan = order
        else:
            assert plan is not None
            # Blocks until rank 0 takes it, which is at once: it does not wait for its own work.
            comm.send((comm.rank, order, plan.work(order)), dest=0)


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
