"""What rank 0 computes for all ranks, errors included, and what it is given for that."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from carillon.command_line.exit_status import meaning
from carillon.command_line.progress import say
from carillon.errors import one_line

Number = TypeVar("Number", np.float64, np.int64)
T = TypeVar("T")


def bcast_from_root(comm: MPI.Comm, compute: Callable[[], T]) -> T:
    """Call `compute` on rank 0 and give every rank its result, or its exception."""
    result, failure = _attempt(comm, compute)
    if comm.size > 1:
        result, failure = comm.bcast((result, failure), root=0)
    if failure is not None:
        # Every rank raises it, so that no rank is left waiting for the others.
        raise failure
    return cast(T, result)


def compute_on_root(comm: MPI.Comm, compute: Callable[[], T]) -> T | None:
    """Call `compute` on rank 0, which keeps the result; its exception is raised on every rank."""
    result, failure = _attempt(comm, compute)
    failure = comm.bcast(failure, root=0)
    if failure is not None:
        raise failure
    return result


def optional(comm: MPI.Comm, warning: str, compute: Callable[[], T]) -> T | None:
    """Result of what is not needed for the main one; None, and a warning, where it fails.

    Only errors that every rank raises are caught: after any other the ranks have lost each other.

    Parameters
    ----------
    warning
        What the failure means, which begins the warning.
    compute
        Called on every rank.
    """
    try:
        return compute()
    except Exception as error:
        if comm.size > 1 and not getattr(error, "collective", False):
            raise
        _, sentence = meaning(error)
        if comm.rank == 0:
            cause = sentence or f"{type(error).__name__}: {one_line(str(error))}"
            say(f"warning: {warning}: {cause}")
        return None


def ranks_of_machine(comm: MPI.Comm) -> int:
    """How many of the ranks have the memory of this one; collective."""
    machine = comm.Split_type(MPI.COMM_TYPE_SHARED)
    try:
        return int(machine.size)
    finally:
        machine.Free()


def gather_rows(comm: MPI.Comm, part: NDArray[Number]) -> NDArray[Number] | None:
    """Rows of all ranks, of an array (rows, c) that each passes, on rank 0; None elsewhere."""
    rows = comm.gather(len(part))
    if rows is None:
        comm.Gatherv(part, None)
        return None
    columns = part.shape[1]
    whole = np.empty((sum(rows), columns), dtype=part.dtype)
    comm.Gatherv(part, (whole, [columns * each for each in rows]))
    return whole


def _attempt(comm: MPI.Comm, compute: Callable[[], T]) -> tuple[T | None, Exception | None]:
    """Result of `compute` on rank 0, or the exception, marked as one that all ranks will raise."""
    if comm.rank == 0:
        try:
            return compute(), None
        except Exception as error:
            if comm.size > 1:  # else others may be at work that do not know
                error.collective = True  # type: ignore[attr-defined]
            return None, error
    return None, None
