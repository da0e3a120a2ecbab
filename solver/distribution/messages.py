"""Arrays between ranks: contiguous buffers, announced by one short message with their shapes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

AnyArray = NDArray[Any]

MOST_ARRAYS = 10
"""Largest number of arrays in one announcement."""
MOST_DIMENSIONS = 3

_TYPES = tuple(np.dtype(name) for name in ("f8", "i8", "i4", "u1"))
_FIELDS = 2 + MOST_DIMENSIONS


@dataclass
class Sent:
    """Messages under way.

    Attributes
    ----------
    messages, bytes
        Number of messages and of bytes in them, announcement included.
    """

    messages: int = 0
    bytes: int = 0
    _requests: list[MPI.Request] = field(default_factory=list)
    _buffers: list[AnyArray] = field(default_factory=list)

    def post(self, comm: MPI.Comm, array: AnyArray, rank: int, tag: int) -> None:
        """Start to send one contiguous array; it is kept alive until `wait`."""
        self._requests.append(comm.Isend(array, dest=rank, tag=tag))
        self._buffers.append(array)
        self.messages += 1
        self.bytes += array.nbytes

    def wait(self) -> None:
        """Return when every message has left its buffer."""
        MPI.Request.Waitall(self._requests)
        self._requests.clear()
        self._buffers.clear()


def send_arrays(comm: MPI.Comm, arrays: Sequence[AnyArray], rank: int, tag: int) -> Sent:
    """Start to send `arrays` to `rank`, for `receive_arrays`; empty ones need no message.

    Arrays that are contiguous are not copied and must not be changed before `Sent.wait`.
    """
    if len(arrays) > MOST_ARRAYS:
        raise ValueError(f"{len(arrays)} arrays in one message, expected at most {MOST_ARRAYS}")
    header = np.zeros((MOST_ARRAYS + 1, _FIELDS), dtype=np.int64)
    header[0, 0] = len(arrays)
    for entry, array in zip(header[1:], arrays):
        entry[0] = _TYPES.index(array.dtype)
        entry[1] = array.ndim
        entry[2 : 2 + array.ndim] = array.shape
    sent = Sent()
    sent.post(comm, header, rank, tag)
    for array in arrays:
        if array.size:
            sent.post(comm, np.ascontiguousarray(array), rank, tag)
    return sent


def receive_arrays(comm: MPI.Comm, rank: int, tag: int) -> list[AnyArray]:
    """Arrays that `rank` sent by `send_arrays`, in row-major order."""
    header = np.empty((MOST_ARRAYS + 1, _FIELDS), dtype=np.int64)
    comm.Recv(header, source=rank, tag=tag)
    arrays = []
    for code, dimensions, *shape in header[1 : 1 + header[0, 0]].tolist():
        array = np.empty(shape[:dimensions], dtype=_TYPES[code])
        if array.size:
            comm.Recv(array, source=rank, tag=tag)
        arrays.append(array)
    return arrays
