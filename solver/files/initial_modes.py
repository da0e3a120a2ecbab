"""Modes that a correction starts from: read from a file or given whole, scattered to the ranks."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from carillon.arrays import Array, Integers
from carillon.errors import UserError
from carillon.fem.block import degrees_of_freedom
from carillon.fem.model import Solid
from carillon.files.datasets import INTEGER, find, finite, read
from carillon.files.hdf5 import open_h5
from carillon.processes.mpi import MPI
from solver.distribution.collective import bcast_from_root, receive_arrays, send_arrays
from solver.distribution.local_mesh import LocalMesh
from solver.files.cells_group import FINITE_CELLS
from solver.files.modes_file import KIND, SCHEMA

COLUMNS = 16
"""Number of modes that travel together."""
_ROWS = 13


def modes_from_file(
    path: str | Path, model: Solid | None, modes: int, local_mesh: LocalMesh, comm: MPI.Comm
) -> Array:
    """This rank's rows (local unknowns, k) of the modes in a file.

    Raises UserError on every rank, if the file is unusable, of another mesh, or holds fewer modes.

    Parameters
    ----------
    path
        A modes file of the same mesh, of any material; read by rank 0, a few modes at a time.
    model
        The solid whose modes are wanted, on rank 0.
    """

    def check() -> int:
        assert model is not None
        with open_h5(path, KIND, SCHEMA, sealed=True) as file:
            grid = read(file, "node_grid", (None, 3), INTEGER)
            own = f"{FINITE_CELLS}/nodes" if FINITE_CELLS in file else "cells"
            cells = read(file, own, (None, None), INTEGER)
            modes_there = find(file, "modes", (3 * len(grid), None))
            count = int(modes_there.shape[1])
            for first in range(0, count, COLUMNS):
                finite(file, "modes", modes_there[:, first : first + COLUMNS])
        require_same_mesh(str(path), grid, cells, model)
        if count < modes:
            raise UserError(
                f"{path}: holds {count} modes, {modes} are wanted; start from a file with as many"
            )
        return count

    count = bcast_from_root(comm, check)
    return scatter_rows(_read_columns(path, count), count, local_mesh, comm)


def require_same_mesh(name: str, grid: Integers, cells: Integers, solid: Solid) -> None:
    """Raise UserError unless nodes (n, 3) and elements (c, k) of modes are those of a solid."""
    same_nodes = np.array_equal(grid, solid.node_grid)
    if not (same_nodes and np.array_equal(cells, solid.connectivity)):
        raise UserError(
            f"{name}: modes of another mesh ({len(grid):,} nodes), expected the one to solve "
            f"({solid.n_nodes:,} nodes) with any material"
        )


def _read_columns(path: str | Path, count: int) -> Iterator[Array]:
    with open_h5(path, KIND, SCHEMA, sealed=True) as file:
        modes = find(file, "modes", (None, count))
        for first in range(0, count, COLUMNS):
            yield modes[:, first : first + COLUMNS]


def scatter_rows(
    blocks: Iterable[Array], count: int, local_mesh: LocalMesh, comm: MPI.Comm
) -> Array:
    """This rank's rows (local unknowns, count) of column blocks in mesh node order.

    `blocks` are looked at on rank 0 alone, where one of them exists at a time.
    """
    everyone = comm.gather(local_mesh.nodes)
    rows = np.empty((3 * len(local_mesh.nodes), count))
    first = 0
    if comm.rank == 0:
        assert everyone is not None
        dofs = [degrees_of_freedom(nodes) for nodes in everyone]
        for block in blocks:
            sent = [
                send_arrays(comm, [block[dofs[rank]]], rank, _ROWS) for rank in range(1, comm.size)
            ]
            rows[:, first : first + block.shape[1]] = block[dofs[0]]
            for message in sent:
                message.wait()
            first += block.shape[1]
        return rows
    while first < count:
        (block,) = receive_arrays(comm, 0, _ROWS)
        rows[:, first : first + block.shape[1]] = block
        first += block.shape[1]
    return rows
