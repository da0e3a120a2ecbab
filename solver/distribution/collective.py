"""What rank 0 computes for all ranks, errors included, and arrays that ranks send each other.

Arrays travel together in one message, which begins with their shapes: links between machines take
their time for every message.
"""

import math
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from carillon.arrays import Array
from carillon.command_line.exit_status import meaning
from carillon.command_line.progress import say
from carillon.errors import one_line
from carillon.processes.mpi import MPI
from carillon.processes.threads import core_numbers, limit_threads

Number = TypeVar("Number", np.float64, np.int64)
T = TypeVar("T")

AnyArray = NDArray[Any]

MOST_DIMENSIONS = 3
WORD = 8
"""Bytes of what messages of arrays are counted in; each array begins with a new one."""

_TYPES = tuple(np.dtype(name) for name in ("f8", "i8", "i4", "u2", "u1"))
_FIELDS = 2 + MOST_DIMENSIONS


def bcast_from_root(comm: MPI.Comm, compute: Callable[[], T]) -> T:
    """Call `compute` on rank 0 and give every rank its result, or its exception."""
    result, failure = _attempt_on_root(comm, compute)
    if comm.size > 1:
        result, failure = comm.bcast((result, failure), root=0)
    if failure is not None:
        # Every rank raises it, so that no rank is left waiting for the others.
        raise failure
    return cast(T, result)


def compute_on_root(
    comm: MPI.Comm,
    compute: Callable[[], T],
    phase: AbstractContextManager[None] | None = None,
) -> T | None:
    """Call `compute` on rank 0, which keeps the result; its exception is raised on every rank.

    It is timed as a `phase`, if that is given, at whose end the other ranks wait.
    """
    with phase or nullcontext():
        result, failure = _attempt_on_root(comm, compute)
    failure = comm.bcast(failure, root=0)
    if failure is not None:
        raise failure
    return result


def on_every_rank(comm: MPI.Comm, compute: Callable[[], T]) -> T:
    """Call `compute` on every rank, each of which keeps its result.

    Where some fail, every rank raises the exception of the first of them.
    """
    result, failure = _attempt(comm, compute)
    if comm.size > 1:
        failure = next(filter(None, comm.allgather(failure)), None)
    if failure is not None:
        raise failure
    return cast(T, result)


def optional(comm: MPI.Comm, warning: str, compute: Callable[[], T]) -> T | None:
    """Result of what is not needed for the main one; None, and a warning, where it fails.

    Only errors that every rank raises are caught: after any other the ranks have lost each other.
    The warning begins with what the failure means.
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


def machine_of(comm: MPI.Comm) -> MPI.Comm:
    """The ranks that have the memory of this one, to be freed by the caller; collective.

    All that depends on machines asks here, so that the ranks of one can be tried as those of many.
    """
    return comm.Split_type(MPI.COMM_TYPE_SHARED)


def ranks_of_machine(comm: MPI.Comm) -> int:
    """How many of the ranks have the memory of this one; collective."""
    return sum_over_machine(comm, 1)


def sum_over_machine(comm: MPI.Comm, number: int) -> int:
    """Sum of what each rank of this machine passes; collective."""
    machine = machine_of(comm)
    try:
        return int(machine.allreduce(number))
    finally:
        machine.Free()


def share_cores(comm: MPI.Comm) -> int:
    """Give this rank as many threads as it has cores for itself, and return them; collective.

    A launcher may have bound every rank to cores of its own, or all to the same ones.
    """
    machine = machine_of(comm)
    try:
        cores = set[int]().union(*machine.allgather(core_numbers()))
        return limit_threads(machine.size, len(cores))
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


def _attempt_on_root(comm: MPI.Comm, compute: Callable[[], T]) -> tuple[T | None, Exception | None]:
    """See `_attempt`; nothing on the other ranks."""
    return _attempt(comm, compute) if comm.rank == 0 else (None, None)


def _attempt(comm: MPI.Comm, compute: Callable[[], T]) -> tuple[T | None, Exception | None]:
    """Result of `compute`, or the exception, marked as one that all ranks will raise."""
    try:
        return compute(), None
    except Exception as error:
        if comm.size > 1:  # else others may be at work that do not know
            error.collective = True  # type: ignore[attr-defined]
        return None, error


class Sent:
    """A message under way, and the number of its `bytes`; its buffer lives until `wait`."""

    def __init__(self, request: MPI.Request, buffer: AnyArray) -> None:
        self.bytes = buffer.nbytes
        self._request = request
        self._buffer: AnyArray | None = buffer

    def wait(self) -> None:
        """Return when the message has left its buffer."""
        self._request.Wait()
        self._buffer = None


def send_arrays(comm: MPI.Comm, arrays: Sequence[AnyArray], rank: int, tag: int) -> Sent:
    """Start to send `arrays` to `rank` in one message, for `receive_arrays`; they are copied."""
    header = np.zeros(1 + _FIELDS * len(arrays), dtype=np.int64)
    header[0] = len(arrays)
    for entry, array in zip(header[1:].reshape(-1, _FIELDS), arrays, strict=True):
        entry[0] = _TYPES.index(array.dtype)
        entry[1] = array.ndim
        entry[2 : 2 + array.ndim] = array.shape
    buffer = np.empty(len(header) + sum(_words(array.nbytes) for array in arrays))
    buffer[: len(header)] = header.view(np.float64)
    place = len(header)
    for array in arrays:
        words = _words(array.nbytes)
        _as_array(buffer[place : place + words], array.dtype, array.shape)[...] = array
        place += words
    return Sent(comm.Isend(buffer, dest=rank, tag=tag), buffer)


def receive_arrays(comm: MPI.Comm, rank: int, tag: int) -> list[AnyArray]:
    """Arrays that `rank` sent by `send_arrays`, in row-major order; they share one buffer."""
    status = MPI.Status()
    message = comm.Mprobe(source=rank, tag=tag, status=status)
    buffer = np.empty(status.Get_count(MPI.DOUBLE))
    message.Recv(buffer)
    place = 1 + _FIELDS * int(buffer[:1].view(np.int64)[0])
    arrays = []
    for code, dimensions, *sides in buffer[1:place].view(np.int64).reshape(-1, _FIELDS).tolist():
        shape, dtype = tuple(sides[:dimensions]), _TYPES[code]
        words = _words(math.prod(shape) * dtype.itemsize)
        arrays.append(_as_array(buffer[place : place + words], dtype, shape))
        place += words
    return arrays


def _words(size: int) -> int:
    """Words that so many bytes take."""
    return -(-size // WORD)


def _as_array(words: Array, dtype: np.dtype[Any], shape: tuple[int, ...]) -> AnyArray:
    """An array in the first bytes of some words."""
    return words.view(np.uint8)[: math.prod(shape) * dtype.itemsize].view(dtype).reshape(shape)
