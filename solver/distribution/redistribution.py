"""Rows of vectors from one cut of a solid to another, on the same ranks: one message a pair."""

import numpy as np

from carillon.arrays import Array, Index
from carillon.processes.mpi import MPI
from solver.distribution.local_mesh import LocalMesh

_REDISTRIBUTED = 22


class Redistribution:
    """Takes the rows of the nodes that ranks own in one distribution to their owners in another.

    Made by all ranks together. A rank compares its nodes with those of each other rank in turn, so
    that no rank holds those of all. Nothing is to do where both are the same local mesh.
    """

    def __init__(self, source: LocalMesh, target: LocalMesh, comm: MPI.Comm) -> None:
        self._comm = comm
        self._same = source is target
        if self._same:
            return
        self._nodes = len(target.nodes)
        taken, placed = [], []
        for rank in range(comm.size):
            wanted = comm.bcast(target.nodes, root=rank)
            _, here, there = np.intersect1d(
                source.nodes, wanted, assume_unique=True, return_indices=True
            )
            taken.append(here)
            placed.append(there)
        self._sent = _of_others(taken, comm.rank)
        self._own = taken[comm.rank], placed[comm.rank]
        self._received = _of_others(comm.alltoall(placed), comm.rank)

    def rows(self, block: Array) -> Array:
        """This rank's rows (3 nodes, k) of the target, of rows (3 nodes, k) of the source.

        Every rank must call it, with as many columns; not a bit of the numbers changes.
        """
        if self._same:
            return block
        columns = 3 * block.shape[1]
        nodes = np.ascontiguousarray(block).reshape(len(block) // 3, columns)
        result = np.empty((self._nodes, columns), dtype=block.dtype)
        received = [
            (places, np.empty((len(places), columns), dtype=block.dtype))
            for places in self._received.values()
        ]
        requests = [
            self._comm.Irecv(rows, source=rank, tag=_REDISTRIBUTED)
            for rank, (_, rows) in zip(self._received, received, strict=True)
        ]
        buffers = [(rank, nodes[places]) for rank, places in self._sent.items()]
        requests += [
            self._comm.Isend(rows, dest=rank, tag=_REDISTRIBUTED) for rank, rows in buffers
        ]
        here, there = self._own
        result[there] = nodes[here]
        MPI.Request.Waitall(requests)
        for places, rows in received:
            result[places] = rows
        return result.reshape(3 * self._nodes, block.shape[1])


def _of_others(places: list[Index], rank: int) -> dict[int, Index]:
    """Places by the other ranks that have any."""
    return {other: each for other, each in enumerate(places) if len(each) and other != rank}
