"""Exchange of the rows that ranks need of each other: one message a neighbour."""

import numpy as np

from carillon.arrays import Array, Index
from carillon.processes.mpi import MPI

_HALO = 21


class Halo:
    """Exchange of the rows that ranks need of each other, three for a node.

    Parameters
    ----------
    ghosts
        (g,) numbers of the nodes that this rank needs of others, ascending.
    start, starts
        First node of this rank, and (ranks + 1,) of every rank.
    """

    def __init__(self, ghosts: Index, start: int, starts: Index, comm: MPI.Comm) -> None:
        self._comm = comm
        bounds = np.searchsorted(ghosts, starts)
        self._received = [
            (rank, bounds[rank], bounds[rank + 1])
            for rank in range(comm.size)
            if bounds[rank] < bounds[rank + 1]
        ]
        needed = [ghosts[bounds[rank] : bounds[rank + 1]] for rank in range(comm.size)]
        self._ghosts = len(ghosts)
        asked = comm.alltoall(needed) if comm.size > 1 else [needed[0]]
        self._sent = [(rank, rows - start) for rank, rows in enumerate(asked) if len(rows)]

    def exchange(self, block: Array) -> Array:
        """Rows (3 g, k) of the ghosts, of a block (3 local nodes, k) that every rank passes."""
        if not self._received and not self._sent:
            return block[:0]
        ghosts = np.empty((self._ghosts, 3, block.shape[1]), dtype=block.dtype)
        nodes = block.reshape(-1, 3, block.shape[1])
        requests = [
            self._comm.Irecv(ghosts[start:stop], source=rank, tag=_HALO)
            for rank, start, stop in self._received
        ]
        buffers = [(rank, nodes[rows]) for rank, rows in self._sent]
        requests += [self._comm.Isend(rows, dest=rank, tag=_HALO) for rank, rows in buffers]
        MPI.Request.Waitall(requests)
        return ghosts.reshape(-1, block.shape[1])
