"""Tasks shared among MPI ranks: each does every so-manieth, rank 0 writes all of them in order."""

import logging
from collections.abc import Callable, Generator

from carillon.errors import UserError
from carillon.processes.ranks import Comm
from carillon.processes.threads import core_numbers
from dataset_gen.generate import Engine
from dataset_gen.tasks import ShardPlan

logger = logging.getLogger(__name__)


def run_on_ranks(comm: Comm, make: Callable[[Engine], int]) -> int:
    """Call `make` on rank 0 with an engine for which all ranks work; its exit status on every rank.

    Raises UserError on every rank if `make` raises it before the ranks have begun to work; later,
    on the one rank that failed, see `exit_status.run`, which ends all of them.
    """
    _warn_about_cores(comm)
    if comm.rank > 0:
        return _follow(comm)
    at_work: list[ShardPlan] = []

    def on_ranks(plan: ShardPlan, tasks: range) -> Generator[bytes, None, None]:
        at_work.append(plan)
        comm.bcast((plan, tasks))
        for turn, task in enumerate(tasks):
            rank = turn % comm.size
            yield plan.work(task) if rank == 0 else comm.recv(source=rank)
        at_work.clear()

    try:
        status = make(on_ranks)
    except UserError as error:
        if not at_work:
            error.collective = True
            comm.bcast(error)
        raise
    if at_work:  # interrupted, with the others in the middle of their work
        comm.Abort(status)
    comm.bcast(status)
    return status


def _follow(comm: Comm) -> int:
    """Do this rank's share of what rank 0 hands out, until that says how all of it ended."""
    while True:
        message = comm.bcast(None)
        if isinstance(message, UserError):
            raise message
        if isinstance(message, int):
            return message
        plan, tasks = message
        sent = None
        for task in tasks[comm.rank :: comm.size]:
            rows = plan.work(task)
            # While rank 0 is at work itself, the next task is begun.
            if sent is not None:
                sent.wait()
            sent = comm.isend(rows, dest=0)
        if sent is not None:
            sent.wait()


def _warn_about_cores(comm: Comm) -> None:
    from carillon.processes.mpi import MPI

    node = comm.Split_type(MPI.COMM_TYPE_SHARED)
    cores = set[int]().union(*node.allgather(core_numbers()))
    if node.rank == 0 and node.size > len(cores):
        logger.warning(
            f"{node.size} ranks share {len(cores)} cores, more than that make nothing faster"
        )
    node.Free()
